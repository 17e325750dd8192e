"""Reports whose pictures tell by their colour which they are, and what a browser shows of them."""

from __future__ import annotations

import io
from dataclasses import dataclass, field, replace

import numpy as np
from PIL import Image
from playwright.sync_api import Page, expect

from analysis.page.player import Curve, Player, Step
from analysis.page.report import Report, Table
from analysis.page.video import maps, photographs
from tests.analysis.builders import SCALES, png_bytes, view

LABELS = [*photographs(view(), 96), *maps(view(), "own", SCALES, 96)]
STEPS, TIMES = 7, 13
LOST, BROKEN = 2, 4
"""Steps at which the second view has no picture, and one that does not decode."""


@dataclass
class Opened:
    """A page and what it said and asked for while it was open."""

    page: Page
    messages: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


def ink(step: int, number: int) -> tuple[int, int, int]:
    """Colour that tells the step and the view."""
    return 30 * step + 10, 20 * number + 5, 99


def picture(step: int, number: int) -> bytes:
    pixels = np.full((64, 64, 3), ink(step, number), np.uint8)
    if number % 2:
        return png_bytes(pixels)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="WEBP", lossless=True)
    return buffer.getvalue()


def player(labels: list[str] = LABELS) -> Player:
    times = np.arange(TIMES)
    steps = [Step(2 * step, {label: picture(step, i) for i, label in enumerate(labels)}) for step in range(STEPS)]
    curves = [
        Curve("thesis", "#c9570c", (1e-3 * 1.3**times).tolist()),
        Curve("framed", "#1f6fb4", np.where(times == 6, 0.0, 2e-2 / 1.2**times).tolist()),
    ]
    ratio = {"thesis / framed": [f"{0.1 * time:.3f}" for time in times]}
    return Player(times / 30, steps, curves, "mean squared error", [0.1, 0.2, 0.3], ratio, "A note on the views.")


def gappy() -> Player:
    """No picture of the second view at one step, and broken ones at another: cut off in its header, and noise."""
    made = player()
    steps = list(made.steps)
    steps[LOST] = Step(steps[LOST].number, {**steps[LOST].pictures, LABELS[1]: None})
    cut, noise = picture(BROKEN, 1)[:20], b"no picture" * 9
    steps[BROKEN] = Step(steps[BROKEN].number, {**steps[BROKEN].pictures, LABELS[1]: cut, LABELS[2]: noise})
    return replace(made, steps=steps)


def report(played: Player | None, text: str = "plain") -> Report:
    wide = Table(text, [text] * 6, [[f"{text} of some length"] * 6], text)
    figure = png_bytes(np.zeros((40, 990, 3), np.uint8))
    details = {text: {"a_long_name": "x" * 300, text: {"in": text}}}
    return Report(text, [text, text], wide, [(text, figure)], played, [wide], details)


def shown(page: Page, step: int) -> None:
    """Waits until the page shows the step."""
    expect(page.locator("#player")).to_have_attribute("data-step", str(step), timeout=5000)


def move(page: Page, step: int) -> None:
    page.locator("#slider").fill(str(step))
    shown(page, step)


PICTURES = """() => [...document.querySelectorAll('.frame')].map(frame => {
  const image = frame.querySelector('img');
  if (!image) return null;
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 1;
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0, 1, 1);
  return {src: image.src, alt: image.alt, width: image.naturalWidth, seen: image.checkVisibility(),
          ink: [...context.getImageData(0, 0, 1, 1).data].slice(0, 3)};
})"""


def readings(page: Page) -> list[str]:
    return page.locator(".now td.n").all_text_contents()


def cursor_x(page: Page) -> float:
    """Where the cursor is on the screen."""
    box = page.locator("#cursor line").evaluate("line => line.getBoundingClientRect().x")
    return float(box)
