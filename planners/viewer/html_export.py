"""Plans in motion in one HTML file."""

from __future__ import annotations

import os
from typing import Any

from planners.viewer.arguments import Show, make_show
from planners.viewer.captions import caption_html
from planners.viewer.stage import Stage, quiet, start_server
from planners.viewer.viewer import FRAMES_PER_SECOND
from reliability.item_files import put
from systems.validation import as_path

# A server has to be there while its scene is recorded; viser takes the next port that is free.
_ANY_PORT = 18080
# Frames in documents are wide.
_WIDTH_PER_HEIGHT = 1.7
# Seconds that the end is shown before the motion begins again.
_PAUSE_AT_END = 1.5
# viser fills its element of the page, which leaves room for the caption above it.
_STYLE = (
    "<style>body{display:flex;flex-direction:column}#root{flex:1;height:auto;min-height:0}</style>"
)
_ROOT = '<div id="root">'


def export_html(
    path: str | os.PathLike[str],
    system: Any,
    plans: Any,
    *,
    executed: Any = None,
    goal: Any = None,
    names: Any = None,
) -> None:
    """Write what :func:`show` shows to one HTML file, for papers and documentation.

    The file needs no server and no network, and can stand in an ``iframe``. It plays again and
    again, and has a slider, a button to pause and one for the speed; parts of the scene can be
    hidden through the scene tree at its lower right. It takes 0.8 MB and what the motion needs:
    0.1 MB for the car, 3 MB for two ropes.

    Parameters
    ----------
    path : str or path-like
    system, plans, executed, goal, names
        As for :func:`show`.

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
    OSError
        If the file can't be written.
    """
    file = as_path(path)
    show = make_show(system, plans, executed, goal, names, _WIDTH_PER_HEIGHT)
    put(file, _recorded(show).encode())


def _recorded(show: Show) -> str:
    """Return the page that plays the show, with the caption above viser's scene."""
    server = start_server(port=_ANY_PORT)
    try:
        stage = Stage(server, show.panels, show.layout)
        stage.show_frame(0)
        recording = server.get_scene_serializer()
        for frame in range(1, show.n_frames):
            recording.insert_sleep(1 / FRAMES_PER_SECOND)
            stage.show_frame(frame)
        if show.n_frames > 1:
            recording.insert_sleep(_PAUSE_AT_END)
        page: str = recording.as_html()
    finally:
        with quiet():
            server.stop()
    caption = f'<div style="padding:8px 12px">{caption_html(show.panels)}</div>'
    return page.replace(_ROOT, f"{_STYLE}{caption}{_ROOT}", 1)
