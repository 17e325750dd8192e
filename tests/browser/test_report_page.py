"""The report page in a real browser: it loads, and the slider, keys and clicks move everything."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from analysis.page.player import data
from tests.browser.reports import (
    BROKEN,
    LABELS,
    PICTURES,
    STEPS,
    Opened,
    cursor_x,
    gappy,
    ink,
    move,
    player,
    readings,
    report,
    shown,
)


def test_the_slider_moves_every_view(opened: Opened) -> None:
    """To the picture of that step, decoded: its pixels name step and view."""
    given = data(player())["steps"]
    for step in (0, 3, 6, 1):
        move(opened.page, step)
        for number, found in enumerate(opened.page.evaluate(PICTURES)):
            assert found["src"] == given[step]["pictures"][number] and found["width"] == 64 and found["seen"]
            assert found["ink"] == list(ink(step, number))
            assert found["alt"] == f"{LABELS[number]} at {step / 15:.3f} s"
        assert opened.page.locator("#time").inner_text() == f"t = {step / 15:.3f} s"
        assert opened.page.locator("#count").inner_text() == f"step {step + 1} of {STEPS}"
    assert len(opened.page.evaluate(PICTURES)) == len(LABELS) == 7


def test_the_cursor_follows_and_its_values_are_the_data(opened: Opened) -> None:
    made, places, heights = player(), [], []
    for step in range(STEPS):
        move(opened.page, step)
        places.append(cursor_x(opened.page))
        time = made.steps[step].number
        assert readings(opened.page) == [f"{curve.values[time]:.2e}" for curve in made.curves] + [f"{0.1 * time:.3f}"]
        dots = opened.page.locator("#cursor circle")
        heights.append(float(dots.nth(0).get_attribute("cy") or "nan"))
        assert (dots.nth(1).get_attribute("visibility") == "hidden") == (time == 6), "nothing to point at"
    plot = opened.page.locator("#plot").bounding_box()
    assert plot is not None
    assert np.diff(places) == pytest.approx((places[-1] - places[0]) / (STEPS - 1), abs=0.5)
    assert places[-1] - places[0] > 0.85 * plot["width"] and (np.diff(heights) < 0).all(), "this curve rises"


def test_the_cursor_stands_below_the_thumb(opened: Opened) -> None:
    slider = opened.page.locator("#slider").bounding_box()
    assert slider is not None
    for step, thumb in ((0, slider["x"] + 8), (STEPS - 1, slider["x"] + slider["width"] - 8)):
        move(opened.page, step)
        assert abs(cursor_x(opened.page) - thumb) < 3


def test_keys_move_one_step(opened: Opened) -> None:
    page = opened.page
    page.locator("#slider").focus()
    for key, step in (
        ("ArrowRight", 1),
        ("ArrowRight", 2),
        ("ArrowLeft", 1),
        ("End", 6),
        ("ArrowRight", 6),
        ("Home", 0),
    ):
        page.keyboard.press(key)
        shown(page, step)
        assert page.locator("#slider").get_attribute("aria-valuetext") == f"{step / 15:.3f} s"


def test_a_click_into_the_curves_moves_there(opened: Opened) -> None:
    page = opened.page
    box = page.locator("#plot").bounding_box()
    assert box is not None
    given = data(player())["steps"]
    for step in (5, 2):
        x = (given[step]["x"] + 20.0) * box["width"] / 1060.0
        page.locator("#plot").click(position={"x": x, "y": 60})
        shown(page, step)
        assert page.locator("#slider").input_value() == str(step)
    page.mouse.move(box["x"] + 300, box["y"] + 60)
    assert page.locator("#player").get_attribute("data-step") == "2", "only with the button down"


def test_play_shows_every_step_and_stops_at_the_end(opened: Opened) -> None:
    page, button = opened.page, opened.page.locator(".controls button")
    page.evaluate("""() => { window.seen = []; new MutationObserver(() => window.seen.push(
      Number(document.getElementById('player').dataset.step))).observe(
      document.getElementById('player'), {attributes: true, attributeFilter: ['data-step']}) }""")
    move(page, 2)
    button.click()
    shown(page, STEPS - 1)
    expect(button).to_have_text("play")
    assert page.evaluate("window.seen") == [2, 3, 4, 5, 6]
    # the page itself presses the button, for a slow machine would be late
    page.evaluate("""() => { const player = document.getElementById('player'), button = player.querySelector('button');
      const observer = new MutationObserver(() => { if (player.dataset.step === '1') {
        observer.disconnect(); window.label = button.textContent; button.click() } });
      observer.observe(player, {attributes: true, attributeFilter: ['data-step']}) }""")
    button.click()
    shown(page, 1)
    expect(button).to_have_text("play")
    page.wait_for_timeout(350)
    assert page.evaluate("window.label") == "pause"
    assert page.locator("#player").get_attribute("data-step") == "1", "it stays where it was stopped"


def test_the_last_of_many_moves_wins(opened: Opened) -> None:
    """Pictures that are ready late do not replace those of a later position."""
    opened.page.evaluate("""() => { const slider = document.getElementById('slider');
      for (const step of [6, 1, 5, 2, 4, 3]) { slider.value = step; slider.dispatchEvent(new Event('input')); } }""")
    shown(opened.page, 3)
    opened.page.wait_for_timeout(100)
    assert [found["ink"] for found in opened.page.evaluate(PICTURES)] == [list(ink(3, i)) for i in range(7)]


@pytest.mark.parametrize("width", [1180, 900, 500, 360])
@pytest.mark.parametrize("opened", [report(gappy()), report(None)], indirect=True, ids=["player", "without"])
def test_nothing_runs_over_the_side(opened: Opened, width: int) -> None:
    page = opened.page
    page.set_viewport_size({"width": width, "height": 900})
    page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true })")
    if page.locator("#player").count():
        move(page, BROKEN)
    sizes = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
    assert sizes[0] <= sizes[1] == width
    with Image.open(io.BytesIO(page.screenshot())) as screen:
        assert screen.width == width and np.asarray(screen.convert("L")).std() > 5
    if page.locator("#player").count():
        rows = [round(frame.bounding_box()["y"]) for frame in page.locator(".frame").all()]  # type: ignore[index]
        assert max(map(rows.count, rows)) == (4 if width > 760 else 2), "views in a row"
        slider = page.locator("#slider").bounding_box()
        assert slider is not None and slider["y"] + slider["height"] <= 900, "the slider stays in sight"
