"""A browser, and a report opened in it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright

from analysis.page.report import write_report
from tests.browser.reports import Opened, comparer, report, shown

NAMES = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is on PATH")
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield launched
        launched.close()


@pytest.fixture
def opened(browser: Browser, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Opened]:
    """The page of the report given as parameter, else of the plain one; at the end it has neither failed nor loaded."""
    made = getattr(request, "param", None) or report(comparer())
    write_report(tmp_path / "report.html", made)
    context = browser.new_context(viewport={"width": 1180, "height": 900})
    found = Opened(context.new_page())
    found.page.on("console", lambda message: found.messages.append(message.text))
    found.page.on("pageerror", lambda error: found.messages.append(str(error)))
    found.page.on("dialog", lambda dialog: found.messages.append(dialog.message) or dialog.dismiss())
    found.page.on("request", lambda request: found.requests.append(request.url))
    address = (tmp_path / "report.html").as_uri()
    found.page.goto(address)
    if made.comparer:
        shown(found.page, 0)
    yield found
    assert found.messages == []
    assert [url for url in found.requests if not url.startswith("data:")] == [address]
    context.close()
