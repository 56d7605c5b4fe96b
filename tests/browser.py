"""A headless Chromium for tests of web pages, or the reason why there is none."""

import contextlib
import io
import os
import re
import shutil

import numpy as np
import pytest

# CHROMIUM may name another browser.
CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
# Drawn by the processor, and no calls home.
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-sync",
    "--no-first-run",
    "--no-default-browser-check",
]
# Drawing on a busy processor takes its time.
PATIENCE = 120_000
# Exported pages play at once, and a page that plays leaves a slow processor no time for tests.
_PAUSE = """new MutationObserver((_, watch) => {
  if (!document.querySelector('.mantine-Slider-root')) return;
  watch.disconnect();
  setTimeout(() => window.dispatchEvent(new KeyboardEvent('keydown', {code: 'Space'})), 50);
}).observe(document, {childList: true, subtree: true});"""
_SLIDER = "document.querySelector('.mantine-Slider-root').getBoundingClientRect()"


@contextlib.contextmanager
def open_browser():
    """Yield a browser of playwright's; skip the test where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("there is no Chromium; the variable CHROMIUM can name one")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


class Page:
    """A page with what it complained about and what it asked the network for."""

    def __init__(self, browser, url):
        self.errors, self.requests = [], []
        self.page = browser.new_page(viewport={"width": 760, "height": 420})
        self.page.set_default_timeout(PATIENCE)
        self.page.on("console", lambda m: m.type == "error" and self.errors.append(m.text))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.add_init_script(_PAUSE)
        self.page.goto(url)
        self.page.wait_for_selector(".mantine-Slider-root", state="attached")
        # viser warns of slow drawing, above the scene.
        hidden = "<style>[class*=mantine-Notifications]{display:none!important}</style>"
        self.page.evaluate(f"document.head.insertAdjacentHTML('beforeend', `{hidden}`)")

    def click_slider(self, share):
        """Click at a share of the slider's length."""
        x, y, width, height = self.page.evaluate(
            f"(() => {{ const r = {_SLIDER}; return [r.x, r.y, r.width, r.height]; }})()"
        )
        self.page.mouse.click(x + share * width, y + height / 2)

    def slider_number(self):
        """Return the number beside the slider."""
        values = self.page.evaluate("[...document.querySelectorAll('input')].map(i => i.value)")
        return float(next(value for value in values if re.fullmatch(r"[\d.]+", value)))

    def picture(self):
        """Return the scene as it stands still, as an array of shape (height, width, 3)."""
        pictures = []
        for _ in range(60):
            self.page.wait_for_timeout(500)
            pictures = [*pictures[-2:], self._canvas()]
            if len(pictures) == 3 and all(np.array_equal(pictures[0], one) for one in pictures):
                return pictures[0]
        raise AssertionError("the scene does not come to rest")

    def comes_back_to(self, picture, part):
        """Say whether a part of the page comes to look as it does in a picture."""
        return any(share_that_differs(picture[part], self.picture()[part]) < 5e-4 for _ in range(8))

    def _canvas(self):
        import matplotlib.image

        shot = self.page.screenshot(animations="disabled")
        pixels = matplotlib.image.imread(io.BytesIO(shot))[..., :3]
        return (255 * pixels).round().astype(int)


def share_that_differs(one, other):
    """Return the share of pixels that clearly differ between two pictures."""
    return float((np.abs(one - other).max(axis=2) > 40).mean())
