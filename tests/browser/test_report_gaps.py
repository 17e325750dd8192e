"""The report page in a real browser: missing pictures are shown as missing, and text stays text."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from analysis.page.comparer import Step
from analysis.page.report import write_report
from tests.analysis.page.test_report import EVIL
from tests.browser.reports import BROKEN, LABELS, LOST, Opened, comparer, gappy, ink, move, picture, report, seen, shown


@pytest.mark.parametrize("opened", [report(gappy())], indirect=True, ids=["gappy"])
def test_a_missing_or_broken_picture_is_said_to_be_missing(opened: Opened) -> None:
    """Neither the picture before it nor a broken one is left standing, and the next one comes back."""
    page = opened.page
    for step in (1, LOST, 3, BROKEN, 5):
        move(page, step)
        gone = step in (LOST, BROKEN)
        assert (seen(page, 0.45, 0.8) == [58, 58, 58]) == gone and (seen(page, 0.45, 0.8) == list(ink(step, 2))) != gone
        assert seen(page, 0.55, 0.8) == list(ink(step, 1))
        expect(page.locator(".thumb.lost")).to_have_count(1 if gone else 0)


evil = comparer([*LABELS[:1], EVIL, *LABELS[2:]])
evil = replace(evil, note=EVIL, steps=[*evil.steps[:LOST], Step(2 / 15, {}), *evil.steps[LOST + 1 :]])


@pytest.mark.parametrize("opened", [report(evil, EVIL)], indirect=True, ids=["evil"])
def test_hostile_text_stays_text(opened: Opened) -> None:
    """In the markup and in what the scripts write."""
    page = opened.page
    assert page.title() == page.locator("h1").inner_text() == EVIL
    move(page, 1)
    assert EVIL in page.locator(".reading").first.inner_text()
    assert page.locator("#right").input_value() == EVIL
    move(page, LOST)
    expect(page.locator(".thumb.lost")).to_have_count(4)
    assert page.locator("script[src]").count() == 0


def test_the_policy_stops_what_is_put_into_the_page(browser: Browser, tmp_path: Path) -> None:
    """Script and picture that an error in escaping would let in neither run nor load."""
    write_report(tmp_path / "report.html", report(comparer()))
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
    write_report(tmp_path / "report.html", report(comparer()))
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto((tmp_path / "report.html").as_uri())
    expect(page.locator("noscript p")).to_be_visible()
    expect(page.locator("#slider")).to_be_hidden()
    held = [(image.get_attribute("src") or "").partition(",")[2] for image in page.locator(".thumb img").all()]
    assert [base64.b64decode(data) for data in held] == [picture(0, number) for number in range(3)]
    assert page.locator("svg.plot").count() == 2
    context.close()
