"""The report page in a real browser: what is missing is said to be missing, and text stays text."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from analysis.page.player import Step, data
from analysis.page.report import write_report
from tests.analysis.page.test_report import EVIL
from tests.browser.reports import (
    BROKEN,
    LABELS,
    LOST,
    PICTURES,
    TIMES,
    Opened,
    gappy,
    ink,
    move,
    player,
    readings,
    report,
    shown,
)


@pytest.mark.parametrize("opened", [report(gappy())], indirect=True, ids=["gappy"])
def test_a_missing_or_broken_picture_is_said_to_be_missing(opened: Opened) -> None:
    """Neither the picture before it nor a broken one is left standing, and the next one comes back."""
    page = opened.page
    lost = {LOST: [1], BROKEN: [1, 2]}
    for step in (1, LOST, 3, BROKEN, LOST, BROKEN, 5):
        move(page, step)
        gone = lost.get(step, [])
        for number, found in enumerate(page.evaluate(PICTURES)):
            gap = page.locator(".frame").nth(number).locator(".gap")
            assert gap.is_visible() == (number in gone) == (found is None), (step, number)
            if found is None:
                assert gap.locator("> *").all_inner_texts() == ["missing", LABELS[number], f"{step / 15:.3f} s"]
            else:
                assert found["ink"] == list(ink(step, number))
        boxes = [frame.bounding_box() for frame in page.locator(".frame").all()]
        assert len({round(box["height"]) for box in boxes if box}) == 1, "the gap has the size of a picture"


first_lost = replace(player(), steps=[Step(0, {**player().steps[0].pictures, LABELS[0]: None}), player().steps[1]])


@pytest.mark.parametrize("opened", [report(first_lost)], indirect=True, ids=["first"])
def test_the_first_picture_may_be_missing(opened: Opened) -> None:
    gap = opened.page.locator(".frame").nth(0).locator(".gap")
    assert gap.is_visible() and "missing" in gap.inner_text()
    move(opened.page, 1)
    assert not gap.is_visible() and opened.page.evaluate(PICTURES)[0]["ink"] == list(ink(1, 0))


evil = replace(player([EVIL, *LABELS[1:]]), quantity=EVIL, note=EVIL, readings={EVIL: [EVIL] * TIMES})


evil = replace(evil, steps=[*evil.steps[:LOST], Step(4, {}), *evil.steps[LOST + 1 :]])


@pytest.mark.parametrize("opened", [report(evil, EVIL)], indirect=True, ids=["evil"])
def test_hostile_text_stays_text(opened: Opened) -> None:
    """In the markup and in what the script writes."""
    page = opened.page
    assert page.title() == page.locator("h1").inner_text() == EVIL
    move(page, 1)
    assert page.evaluate(PICTURES)[0]["alt"] == f"{EVIL} at {1 / 15:.3f} s"
    assert readings(page)[-1] == EVIL and page.locator(".now b").inner_text() == EVIL
    move(page, LOST)
    assert page.locator(".gap:visible span").first.text_content() == EVIL
    assert page.locator("script").count() == 2 and page.locator("script[src]").count() == 0


def test_the_policy_stops_what_is_put_into_the_page(browser: Browser, tmp_path: Path) -> None:
    """Script and picture that an error in escaping would let in neither run nor load."""
    write_report(tmp_path / "report.html", report(player()))
    text = (tmp_path / "report.html").read_text()
    hole = "<script>window.ran = true</script><img src='http://evil.invalid/x.png' onerror='window.ran = true'>"
    (tmp_path / "report.html").write_text(text.replace("<h1>", hole + "<h1>"))
    page, messages = browser.new_page(), []
    page.on("console", lambda message: messages.append(message.text))
    page.goto((tmp_path / "report.html").as_uri())
    shown(page, 0)
    assert page.evaluate("window.ran === undefined")
    refused = [text for text in messages if "Content Security Policy" in text]
    assert any("script-src" in text for text in refused) and any("img-src" in text for text in refused), messages
    page.close()


def test_without_javascript_the_first_step_is_shown(browser: Browser, tmp_path: Path) -> None:
    write_report(tmp_path / "report.html", report(gappy()))
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto((tmp_path / "report.html").as_uri())
    expect(page.locator("noscript p")).to_be_visible()
    expect(page.locator("#slider")).to_be_hidden()
    given = data(gappy())["steps"][0]
    assert [image.get_attribute("src") for image in page.locator(".frame img").all()] == given["pictures"]
    assert readings(page) == given["values"] and page.locator(".gap:visible").count() == 0
    context.close()
