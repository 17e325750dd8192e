"""Takes the pictures of the live view and of the report page in a headless Chromium, and a film of a live session.

Usage: python docs/screenshots.py live|film|page [--out FOLDER] [--report PAGE]

They are written as ``live-1440.webp``, ``live-film.webp``, ``page-1440.webp`` and so on.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from analysis.live.engine import Engine
from analysis.live.hub import Hub
from analysis.live.options import Controls, LiveOptions
from analysis.live.server import watching

WAIT_MS = 120_000
SIZES_PX = ((1440, 1000), (1024, 1000), (390, 844))
FILM_PX = (1000, 760)


@contextlib.contextmanager
def browser() -> Iterator[Browser]:
    """A Chromium without a window."""
    with sync_playwright() as play:
        found = shutil.which("chromium") or shutil.which("google-chrome")
        started = play.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield started
        started.close()


@contextlib.contextmanager
def driven(side_px: int) -> Iterator[tuple[Browser, str]]:
    """A live session of the fly-by, framed beside tsar; a browser, and the address of the page."""
    controls = Controls(left="framed", right="tsar", resolution_px=side_px)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        engine = Engine(LiveOptions("fly-by", controls))
        try:
            with watching(Hub(engine), "fly-by") as address, browser() as started:
                yield started, address
        finally:
            engine.close()


def opened(started: Browser, address: str, size: tuple[int, int], scheme: Literal["light", "dark"] = "light") -> Page:
    """The live page, once both sides have been shown for a while."""
    width, height = size
    context = started.new_context(viewport={"width": width, "height": height}, bypass_csp=True, color_scheme=scheme)
    page = context.new_page()
    page.goto(address)
    both = "state && state.drives && state.sides.left.number && state.sides.right.number"
    page.wait_for_function(both, timeout=WAIT_MS)
    shown = int(page.locator("#live").get_attribute("data-frames") or 0)
    page.wait_for_function(f"Number(live.dataset.frames) > {shown + 60}", timeout=WAIT_MS)
    return page


def keep(page: Page, file: Path, whole: bool = False) -> None:
    """Writes what a page shows."""
    shown = Image.open(io.BytesIO(page.screenshot(type="png", full_page=whole))).convert("RGB")
    shown.save(file, quality=88, method=6)
    print(file)


def live(folder: Path) -> None:
    """The live view at three widths: an overlay; dark, a moment that is held; on a phone."""
    with driven(512) as (started, address):
        page = opened(started, address, SIZES_PX[0])
        page.locator("#o-right").select_option("expected error")
        page.wait_for_function("document.getElementById('right-said').textContent.includes('expected error')")
        page.wait_for_timeout(10_500)  # until the curves are full
        keep(page, folder / "live-1440.webp")
        page.locator("#o-right").select_option("none")
        page.close()
        page = opened(started, address, SIZES_PX[1], "dark")
        page.wait_for_timeout(10_500)
        page.locator("#freeze").click()
        page.wait_for_selector("#frozen:not([hidden])", timeout=WAIT_MS)
        page.locator("#o-right").select_option("squared error")
        page.wait_for_timeout(2000)
        keep(page, folder / "live-1024.webp", whole=True)
        page.locator("#freeze").click()
        page.locator("#o-right").select_option("none")
        page.close()
        page = opened(started, address, SIZES_PX[2])
        page.wait_for_timeout(10_500)
        keep(page, folder / "live-390.webp", whole=True)


def film(folder: Path) -> None:
    """A session at 256² in real time: the camera is driven, a policy and overlays change, the session is saved, and a
    moment is held."""
    shots: list[tuple[float, bytes]] = []
    with driven(256) as (started, address):
        page = opened(started, address, FILM_PX)

        def shoot(seconds: float) -> None:
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                shots.append((time.monotonic(), page.screenshot(type="png")))

        _act(page, shoot)
    times = [moment for moment, _ in shots]
    lengths = [round(1000 * seconds) for seconds in (*np.diff(times), 2.0)]
    pictures = [Image.open(io.BytesIO(data)).convert("RGB") for _, data in shots]
    file = folder / "live-film.webp"
    pictures[0].save(file, save_all=True, append_images=pictures[1:], duration=lengths, loop=0, quality=60, method=6)
    print(f"{file}: {len(shots)} pictures in {times[-1] - times[0]:.0f} s")


def _act(page: Page, shoot: Callable[[float], None]) -> None:
    page.locator("#record").click()
    shoot(2)
    box = page.locator("#stage").bounding_box()
    assert box is not None
    x, y = box["x"] + 200, box["y"] + 150
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(10):
        page.mouse.move(x + 8 * step, y + 2 * step)
        shoot(0.15)
    page.mouse.up()
    page.locator("#stage").focus()
    page.keyboard.down("w")
    shoot(1.5)
    page.keyboard.up("w")
    shoot(0.5)
    page.locator("#c-right").select_option("thesis")
    shoot(2)
    page.locator("#o-right").select_option("tiling by refresh rate")
    shoot(2)
    page.locator("#o-right").select_option("none")
    page.locator("#c-right").select_option("tsar")
    shoot(1.5)
    page.locator("#save").click()
    shoot(0.5)
    page.locator("#freeze").click()
    shoot(2.5)


def page(folder: Path, report: Path) -> None:
    """The report page at three widths; at 1024 pixels dark, with the squared errors."""
    with browser() as started:
        for (width, height), scheme in zip(SIZES_PX, ("light", "dark", "light"), strict=True):
            shown = started.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
            shown.goto(report.resolve().as_uri(), timeout=WAIT_MS)
            shown.wait_for_timeout(4000)
            shown.locator("input[type=range]").first.fill("29")
            shown.wait_for_timeout(2000)
            if scheme == "dark":
                shown.get_by_label("squared error").first.check()
            box = shown.locator("canvas").first.bounding_box()
            assert box is not None
            shown.mouse.move(box["x"] + 0.55 * box["width"], box["y"] + 0.55 * box["height"])
            shown.wait_for_timeout(2000)
            keep(shown, folder / f"page-{width}.webp", whole=width == 390)
            shown.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["live", "film", "page"])
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"), help="folder for the pictures")
    parser.add_argument("--report", type=Path, default=Path("out/demo/report.html"), help="page of a finished run")
    given = parser.parse_args()
    if given.what == "page" and not given.report.is_file():
        parser.error(f"--report: expected the page of a finished run, found none at {given.report}")
    folder = given.out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if given.what == "page":
        page(folder, given.report)
    else:
        {"live": live, "film": film}[given.what](folder)


if __name__ == "__main__":
    main()
