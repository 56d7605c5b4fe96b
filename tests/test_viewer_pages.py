"""The viewer's pages in a real browser, where viser, playwright and Chromium are installed."""

import re
import signal
import socket
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from browser import Page, open_browser, share_that_differs
from drawn_toys import DrawnDisc

from planners import BiasedRRTConnect, export_html, show
from planners.viewer.colors import css, reliability_colors

pytest.importorskip("viser", reason="viser is not installed: transition-reliability[viewer]")

DISC = DrawnDisc()
START, GOAL = np.array([-0.9, 0.0]), np.array([[0.9, 0.2]])
PLAN = BiasedRRTConnect(DISC, random_state=0).plan(START, GOAL)
PLAN = replace(PLAN, reliability=np.full(len(PLAN.commands), 0.95))
ROLLOUT = DISC.rollout(START, PLAN.commands)
ALL = {"executed": ROLLOUT, "goal": GOAL}


@pytest.fixture(scope="module")
def browser():
    with open_browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    path = tmp_path_factory.mktemp("exported") / "plan.html"
    export_html(path, DISC, PLAN, names="disc", **ALL)
    return path


def answers(url):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", int(url.rsplit(":", 1)[1]))) == 0


def test_an_exported_page_holds_all_it_needs_and_says_what_it_shows(exported):
    page = exported.read_text()
    addresses = set(re.findall(r"https?://[\w./-]+", page))
    assert addresses <= {"http://www.w3.org/2000/svg"}, "a name, not an address to load from"
    assert not re.search(r"""<(?:script|link|img)[^>]*(?:src|href)=["'](?!data:)""", page)
    assert "disc:" in page
    assert [file.name for file in exported.parent.iterdir()] == ["plan.html"]


def test_an_export_that_fails_leaves_the_old_file(exported):
    before = exported.read_bytes()
    with pytest.raises(ValueError, match="plans must be"):
        export_html(exported, DISC, [3])
    assert exported.read_bytes() == before


def test_a_viewer_does_not_block_and_closes_cleanly(capsys):
    with show(DISC, PLAN, block=False) as viewer, show(DISC, PLAN, block=False) as other:
        assert viewer.url != other.url
        assert answers(viewer.url)
        assert answers(other.url)
        assert viewer.url in repr(viewer)
    assert not answers(viewer.url)
    viewer.close()
    assert "closed" in repr(viewer)
    told = capsys.readouterr().err
    assert told.splitlines()[0] == f"Open {viewer.url} in a browser to see the plans."
    assert len(told.splitlines()) == 2


def test_a_script_waits_for_ctrl_c_and_then_goes_on():
    code = f"""
import sys
sys.path[:0] = {sys.path!r}
from test_viewer_pages import DISC, PLAN
from planners import show
viewer = show(DISC, PLAN)
print("went on", viewer)
"""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-uc", code], text=True, **pipes) as ran:
        assert ran.stderr.readline().startswith("Open http://127.0.0.1")
        with pytest.raises(subprocess.TimeoutExpired):
            ran.wait(2)
        ran.send_signal(signal.SIGINT)
        assert ran.stdout.read() == "went on <Viewer of 1 plans: closed>\n"
    assert ran.returncode == 0


@pytest.mark.slow
def test_the_live_page_moves_the_robot_and_plays(browser):
    with show(DISC, PLAN, block=False, **ALL) as viewer:
        page = Page(browser, viewer.url)
        page.click_slider(0.1)
        first = page.picture()
        page.click_slider(0.8)
        later = page.picture()
        assert page.slider_number() > 0.5 * len(PLAN.commands)
        assert share_that_differs(first[:, :380], later[:, :380]) > 0.002
        page.click_slider(0.1)
        assert page.comes_back_to(first, np.s_[:, :380])
        page.page.get_by_role("button", name="Play").click()
        page.page.get_by_role("button", name="Pause").wait_for()
        page.page.get_by_role("button", name="Play").wait_for()
        assert page.slider_number() == len(PLAN.commands)
        before = page.picture()
        page.page.evaluate("document.querySelector('input[type=checkbox]').click()")
        assert share_that_differs(before, page.picture()) > 0.001
    assert page.errors == []
    assert all(re.match(r"(data|blob:)?.*127\.0\.0\.1|data:", url) for url in page.requests)


@pytest.mark.slow
def test_the_exported_page_moves_the_robot_and_plays(browser, exported):
    page = Page(browser, exported.as_uri())
    page.click_slider(0.02)
    first = page.picture()
    page.click_slider(0.6)
    later = page.picture()
    assert share_that_differs(first[:-40], later[:-40]) > 0.002
    page.click_slider(0.02)
    assert page.comes_back_to(first, np.s_[:-40])
    before = page.slider_number()
    page.page.keyboard.press("Space")
    page.page.wait_for_function(f"Number(document.querySelector('input').value) > {before} + 0.3")
    page.page.keyboard.press("Space")
    assert page.errors == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in page.requests)


@pytest.mark.slow
def test_paths_have_the_colours_of_the_legend(browser, tmp_path):
    """viser takes the colours of lines for linear light, which the viewer allows for."""
    export_html(tmp_path / "plan.html", DISC, PLAN)
    pixels = Page(browser, (tmp_path / "plan.html").as_uri()).picture()
    expected = np.array(
        [int(css(reliability_colors(np.array([0.95]))[0])[i : i + 2], 16) for i in (1, 3, 5)]
    )
    near = np.abs(pixels[100:-45] - expected).max(axis=2) < 25
    assert near.sum() > 100
