"""Reports whose pictures are identified by their colour, and readings of a browser that shows them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from playwright.sync_api import Page, expect

from analysis.page.comparer import Comparer, Panel, Step
from analysis.page.curves import Curve, Plot
from analysis.page.pictures import ColorScale, picture_bytes
from analysis.page.report import Report, Table
from tests.analysis.builders import png_bytes

LABELS = ["reference", "tsar", "framed", "age of samples"]
STEPS, SIDE = 7, 64
LOST, BROKEN = 2, 4
"""Steps at which the run framed has no picture, and one that does not decode."""
SCALE = ColorScale.of((1.0, 1000.0), "ms", "viridis", special=(200, 0, 0), meaning="not sampled yet")


@dataclass
class Opened:
    """A page, with its messages and requests while it was open."""

    page: Page
    messages: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


def ink(step: int, number: int) -> tuple[int, int, int]:
    """Colour that tells the step and the panel."""
    return 30 * step + 10, 20 * number + 5, 99


def picture(step: int, number: int) -> bytes:
    if number == 3:
        return picture_bytes(np.full((16, 16), 40 * step, np.uint8), exact=True)
    pixels = np.full((SIDE, SIDE, 3), ink(step, number), np.uint8)
    return png_bytes(pixels) if number % 2 else picture_bytes(pixels, exact=True)


def comparer(labels: list[str] = LABELS) -> Comparer:
    panels = [Panel(labels[0]), *(Panel(name, truth=labels[0]) for name in labels[1:3]), Panel(labels[3], scale=SCALE)]
    steps = [Step(step / 15, {name: picture(step, i) for i, name in enumerate(labels)}) for step in range(STEPS)]
    times = (np.arange(13) / 30).tolist()
    errors = [
        Curve(labels[1], times, (1e-3 * 1.3 ** np.arange(13)).tolist(), 0),
        Curve(labels[2], times, (2e-2 / 1.2 ** np.arange(13)).tolist(), 1),
    ]
    plots = [
        Plot("Mean squared error", "", errors, marks_s=[0.1, 0.2, 0.3]),
        Plot("Stages", "ms", [Curve("tracing", [-0.1, 0.1, 0.2], [1.0, 2.0, 3.0], 0)], logarithmic=False),
    ]
    return Comparer(panels, steps, labels[2], labels[1], plots, "A note on the pictures.")


def gappy() -> Comparer:
    """No picture of the run framed at one step, and a broken one at another."""
    made = comparer()
    steps = list(made.steps)
    steps[LOST] = replace(steps[LOST], pictures={**steps[LOST].pictures, "framed": None})
    steps[BROKEN] = replace(steps[BROKEN], pictures={**steps[BROKEN].pictures, "framed": b"no picture" * 9})
    return replace(made, steps=steps)


def report(compared: Comparer | None, text: str = "plain") -> Report:
    wide = Table(text, [text] * 6, [[f"{text} of some length"] * 6], text)
    figure = png_bytes(np.zeros((40, 990, 3), np.uint8))
    details = {f"{text}, details": {"a_long_name": "x" * 300, text: {"in": text}}}
    numbers = Table(f"{text} numbers", ["", text], [[text, "3"]])
    return Report(text, [text, text], numbers, [(text, figure)], compared, [wide], details)


def shown(page: Page, step: int) -> None:
    """Waits until the page shows the step."""
    expect(page.locator("#comparer")).to_have_attribute("data-step", str(step), timeout=8000)


def move(page: Page, step: int) -> None:
    page.locator("#slider").fill(str(step))
    shown(page, step)


def seen(page: Page, across: float, down: float = 0.5) -> list[int]:
    """Colour of the stage there, in shares of its size."""
    found = page.locator("#stage").evaluate(
        """(canvas, [x, y]) => { const one = document.createElement('canvas'); one.width = one.height = 1;
        const context = one.getContext('2d', {willReadFrequently: true});
        context.drawImage(canvas, -Math.floor(x * canvas.width), -Math.floor(y * canvas.height));
        return [...context.getImageData(0, 0, 1, 1).data].slice(0, 3); }""",
        [across, down],
    )
    return list(found)
