"""The explorer of a page in a real browser: points, their settings where they are hovered over, their pictures where
they are clicked."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
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
    dots, title = page.locator("#explorer .dot"), page.locator("#explorer .title")
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
    moves = [dot.get_attribute("transform") or "" for dot in page.locator(".dot").all()]
    places = [[float(number) for number in re.findall(r"[\d.]+", move)] for move in moves]
    path = page.locator(".front").get_attribute("d") or ""
    assert path.count("H") == path.count("V") == 2 and path.startswith(f"M{places[0][0]:g}"[:6])
    assert places[0][0] < places[1][0] < places[3][0] < places[2][0] and places[0][1] < places[3][1] < places[2][1]


@pytest.mark.parametrize("opened", [PAGE], indirect=True, ids=["grey"])
def test_kinds_differ_in_their_marks(opened: Opened) -> None:
    """As the legend says, so that they can be told apart in grey."""
    marks = [dot.get_attribute("d") for dot in opened.page.locator(".dot").all()]
    assert len(set(marks[:3])) == 1 and marks[3] not in marks[:3]
    legend = opened.page.locator(".legend path")
    assert [mark.get_attribute("d") for mark in legend.all()] == [marks[0], marks[3]]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("opened", [PAGE], indirect=True, ids=["axe"])
def test_no_rule_of_axe_is_broken(opened: Opened, scheme: Any) -> None:
    page = opened.page
    page.emulate_media(color_scheme=scheme)
    for width in (1440, 1024, 390):
        page.set_viewport_size({"width": width, "height": 900})
        page.locator("#explorer .dot").nth(1).click()
        found = Axe().run(page)
        assert found.violations_count == 0, found.generate_report()
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_an_explorer_without_points_is_refused() -> None:
    with pytest.raises(ValueError, match="explorer: expected at least one point"):
        replace(EXPLORER, points=[])
