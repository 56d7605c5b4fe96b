"""Plans in motion on a web page."""

from __future__ import annotations

import sys
import threading
from types import TracebackType
from typing import Any

from planners.viewer.arguments import Show, make_show
from planners.viewer.captions import caption_html
from planners.viewer.stage import PARTS, Stage, quiet, start_server
from systems.messages import tell
from systems.validation import check_flag, is_integer

FRAMES_PER_SECOND = 20
_PLAY, _PAUSE = "Play", "Pause"


def show(
    system: Any,
    plans: Any,
    *,
    executed: Any = None,
    goal: Any = None,
    names: Any = None,
    port: int = 8080,
    block: bool | None = None,
) -> Viewer:
    """Show plans, and what came of them, on a web page with a slider for the time.

    Several plans stand side by side, and move together. Each is shown in its scene with its search
    tree, its path, coloured by the reliability of each transition, and the path of its execution.
    Along these move the system as planned and, if there is an execution, as executed; the planned
    one is translucent then. Between two states that are known, all moves straight.

    Only this machine can reach the page. :func:`export_html` writes what is shown to a file.

    Parameters
    ----------
    system : System, or sequence of Systems
        That the plans are for; one for all of them, or one for each. It has to define ``draw``;
        see :class:`systems.System`.
    plans : PlanResult, Execution, or sequence of them
        As ``plan`` and :func:`execute` return them. Without a plan there is still the tree.
    executed : Rollout, or sequence of Rollout and None, default=None
        What ``system.rollout(start, plan.commands)`` returned for each PlanResult.
    goal : array-like of shape (n_goals, configuration_dim), or GoalRegion, default=None
        As it was given to ``plan``; of a region, 40 configurations are drawn.
    names : str or sequence of str, default=None
        What to call each plan.
    port : int, default=8080
        If it is taken, the next one that is free.
    block : bool, default=None
        Whether to return only after Ctrl-C. None does so in scripts and not in interactive
        sessions, just as matplotlib's ``show``. Without blocking, the page is there until the
        viewer is closed or Python ends.

    Returns
    -------
    viewer : Viewer
        ``viewer.url`` is the page's address, which also goes to the standard error stream.

    Raises
    ------
    ImportError
        If viser is not installed: it comes with ``transition-reliability[viewer]``.
    NotImplementedError
        If the system does not define ``draw``.
    SystemContractError
        If a method of the system that draws returns something else than shapes.
    ValueError
        If an argument is unfit.

    Examples
    --------
    >>> from planners import BiasedRRTConnect, show
    >>> from systems import PlanarArm
    >>> arm = PlanarArm()
    >>> problem = arm.sample_problem(0)
    >>> plan = BiasedRRTConnect(arm, random_state=0).plan(problem.start, problem.goal)
    >>> rollout = arm.rollout(problem.start, plan.commands)
    >>> show(arm, plan, executed=rollout, goal=problem.goal)  # doctest: +SKIP
    """
    if not is_integer(port) or not 0 < port < 2**16:
        raise ValueError(f"port must be an integer between 1 and 65535, got {port!r}.")
    if block is not None:
        check_flag(block, "block")
    viewer = Viewer(make_show(system, plans, executed, goal, names), port)
    tell(f"Open {viewer.url} in a browser to see the plans.")
    if block or (block is None and not _is_interactive()):
        viewer.wait()
    return viewer


class Viewer:
    """A page that shows plans, as :func:`show` returns it; can be used as a context manager.

    Parameters
    ----------
    show : object
        What is shown, made by :func:`show`.
    port : int

    Attributes
    ----------
    url : str
        The page's address.
    """

    def __init__(self, show: Show, port: int) -> None:
        self._show = show
        self._closed = threading.Event()
        self._playing = threading.Event()
        self._server = start_server(port)
        self.url = f"http://127.0.0.1:{self._server.get_port()}"
        self._stage = Stage(self._server, show.panels, show.layout)
        self._stage.show_frame(0)
        self._add_controls()
        self._player = threading.Thread(target=self._play, daemon=True)
        self._player.start()

    def __repr__(self) -> str:
        state = "closed" if self._closed.is_set() else self.url
        return f"<Viewer of {len(self._show.panels)} plans: {state}>"

    def __enter__(self) -> Viewer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Take the page from the net; may be called more than once."""
        if self._closed.is_set():
            return
        self._closed.set()
        self._playing.set()
        self._player.join()
        with quiet():
            self._server.stop()

    def wait(self) -> None:
        """Wait until Ctrl-C is pressed or another thread closes the viewer; then it is closed."""
        try:
            self._closed.wait()
        except KeyboardInterrupt:
            self.close()

    def _add_controls(self) -> None:
        gui, show = self._server.gui, self._show
        gui.configure_theme(show_logo=False, show_share_button=False)
        # At the right edge, the controls hide nothing of the scene.
        gui.main_panel.dock_right()
        gui.set_panel_label("Plans")
        self._slider = gui.add_slider(
            "transition",
            min=0.0,
            max=float(max(show.n_transitions, 1)),
            step=1 / show.frames_per_transition,
            initial_value=0.0,
            disabled=show.n_transitions == 0,
        )
        self._slider.on_update(lambda _: self._stage.show_frame(self._frame()))
        self._button = gui.add_button(_PLAY, disabled=show.n_transitions == 0)
        self._button.on_click(lambda _: self._pause() if self._playing.is_set() else self._start())
        for part, label in PARTS.items():
            self._add_checkbox(part, label)
        gui.add_html(f'<div style="padding:6px 10px">{caption_html(show.panels)}</div>')

    def _add_checkbox(self, part: str, label: str) -> None:
        box = self._server.gui.add_checkbox(label, initial_value=True)
        box.on_update(lambda _: self._stage.set_visible(part, box.value))

    def _frame(self) -> int:
        frame = round(self._slider.value * self._show.frames_per_transition)
        return min(frame, self._show.n_frames - 1)

    def _start(self) -> None:
        if self._frame() == self._show.n_frames - 1:
            self._slider.value = 0.0
        self._button.label = _PAUSE
        self._playing.set()

    def _pause(self) -> None:
        self._playing.clear()
        self._button.label = _PLAY

    def _play(self) -> None:
        """Move the slider while playing; runs in a thread of its own."""
        while self._playing.wait() and not self._closed.wait(1 / FRAMES_PER_SECOND):
            frame = self._frame() + 1
            self._slider.value = (
                min(frame, self._show.n_frames - 1) / self._show.frames_per_transition
            )
            if frame >= self._show.n_frames - 1:
                self._pause()


def _is_interactive() -> bool:
    return hasattr(sys, "ps1") or bool(sys.flags.interactive)
