"""The explorer of a page in a real browser: points, their settings where they are hovered over, their pictures where
they are clicked."""

from __future__ import annotations

import io
import re
from dataclasses import replace

import pytest
from PIL import Image
from playwright.sync_api import expect

from analysis.page.explorer import SCRIPT, STYLE, Explorer, PlotPoint
from analysis.page.report import Report, render
from tests.analysis.page.test_report import EVIL
from tests.browser.reports import Opened


def picture(level: int) -> bytes:
    made = io.BytesIO()
    Image.new("RGB", (8, 8), (level, level, level)).save(made, "webp", lossless=True)
    return made.getvalue()


POINTS = [
    PlotPoint("one", "alone", f"setting {k}", {"FLOPs": 10.0**k, "MSE": 10.0 ** (-k), "JOD": k - 1.0}, f"p{k}")
    for k in range(3)
]
BEATEN = PlotPoint("one", "other", EVIL, {"FLOPs": 50.0, "MSE": 0.5, "JOD": float("nan")})
OTHER = PlotPoint("two", "alone", "of two", {"FLOPs": 1.0, "MSE": 2.0, "JOD": 3.0})
EXPLORER = Explorer(
    points=[*POINTS, BEATEN, OTHER],
    across=["FLOPs"],
    upward=["MSE", "JOD"],
    colours={"alone": "#123456", "other": "#abcdef"},
    pictures={**{f"p{k}": picture(40 * k) for k in range(3)}, "truth": picture(250)},
    truths={"one": "truth"},
)
PAGE = Report(title="explorer", lead=["text"], key_numbers=None, explorer=EXPLORER)


@pytest.mark.parametrize("opened", [PAGE], indirect=True, ids=["plain"])
def test_points_show_their_settings_and_pictures(opened: Opened) -> None:
    page = opened.page
    dots, title = page.locator("#explorer circle"), page.locator("#explorer .title")
    expect(dots).to_have_count(4)
    dots.nth(1).hover()
    expect(title).to_have_text("setting 1")
    assert page.locator("#explorer tr").all_inner_texts() == ["FLOPs\t10", "MSE\t0.1", "JOD\t0"]
    assert page.locator("#explorer .pictures img").count() == 0
    dots.nth(2).click()
    expect(page.locator("#explorer .pictures img")).to_have_count(2)
    assert page.locator("#explorer figcaption").all_inner_texts() == ["shown", "reference"]
    page.wait_for_function("[...document.querySelectorAll('.pictures img')].every((one) => one.naturalWidth === 8)")
    dots.nth(3).hover()
    expect(title).to_have_text(EVIL)
    page.mouse.move(2, 2)
    expect(title).to_have_text("setting 2")

    page.locator("#explorer select[name=upward]").select_option("JOD")
    expect(dots).to_have_count(3)
    page.locator("#explorer select[name=group]").select_option("two")
    expect(dots).to_have_count(1)
    dots.first.focus()
    page.keyboard.press("Enter")
    expect(title).to_have_text("of two")
    expect(page.locator("#explorer .pictures img")).to_have_count(0)


def test_the_page_is_self_contained() -> None:
    """Nothing in the page is an address, and what a title holds stays text."""
    text = render(PAGE)
    assert EVIL not in text and text.count("<script") == text.count("</script>") == 2
    plain = SCRIPT.read_text("utf-8") + STYLE
    assert "http" not in plain and not re.search(r"url\(|@import|fetch|XMLHttp|eval\(|innerHTML", plain)


@pytest.mark.parametrize("opened", [PAGE], indirect=True, ids=["front"])
def test_the_line_is_the_front(opened: Opened) -> None:
    page = opened.page
    places = [[float(dot.get_attribute(name) or 0) for name in ("cx", "cy")] for dot in page.locator("circle").all()]
    path = page.locator(".front").get_attribute("d") or ""
    assert path.count("H") == path.count("V") == 2 and path.startswith(f"M{places[0][0]:g}"[:6])
    assert places[0][0] < places[1][0] < places[3][0] < places[2][0] and places[0][1] < places[3][1] < places[2][1]


def test_an_explorer_without_points_is_refused() -> None:
    with pytest.raises(ValueError, match="explorer: expected at least one point"):
        replace(EXPLORER, points=[])
