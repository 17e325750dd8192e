"""A whole short session in a real browser, with a reload in the middle and a server that dies."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from analysis.perception.protocol import TABLE, TrialSession
from analysis.perception.server import serving
from tests.analysis.perception.builders import write_stimuli


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def answered(page: Page, count: int, total: int) -> None:
    expect(page.locator("#progress")).to_have_text(f"{count} of {total}", timeout=10_000)


def press_when_shown(page: Page, key: str) -> None:
    """Waits until the pairs are on the screen and moving."""
    expect(page.locator("#pairs")).to_be_visible(timeout=10_000)
    page.wait_for_function("phase === 'trial' && shown.intervals.length > 3")
    page.keyboard.press(key)


def test_a_session_from_the_first_trial_to_the_last(browser: Browser, tmp_path: Path) -> None:
    stimuli, port, folder = write_stimuli(tmp_path / "stimuli"), free_port(), tmp_path / "session"
    page = browser.new_page(viewport={"width": 900, "height": 700})
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    session = TrialSession(folder, stimuli, "anna", 2, 5)
    total = len(session.trials)
    assert total == 6
    given = {}

    def correct_key(number: int) -> str:
        given[number] = session.trials[number].side
        return {"left": "ArrowLeft", "right": "ArrowRight"}[given[number]]

    with serving(session, port, break_every=3) as address:
        page.goto(address)
        expect(page.locator("#message")).to_contain_text("Press the arrow key")
        page.keyboard.press("ArrowLeft")  # before the start: no answer
        answered(page, 0, total)
        page.keyboard.press("Space")
        press_when_shown(page, correct_key(0))
        answered(page, 1, total)
        sizes = page.eval_on_selector_all("canvas", "all => all.map(one => [one.width, one.height])")
        assert sizes == [[24, 24]] * 4
        page.reload()  # in the middle of a trial
        expect(page.locator("#progress")).to_have_text(f"1 of {total}")
        page.keyboard.press("Space")
        press_when_shown(page, correct_key(1))
        answered(page, 2, total)
        press_when_shown(page, correct_key(2))
        expect(page.locator("#message")).to_contain_text("Time for a break")
        page.keyboard.press("Space")
        expect(page.locator("#pairs")).to_be_visible(timeout=10_000)
        page.wait_for_function("phase === 'trial' && shown.intervals.length > 3")
    # the server is gone, and the answer is given all the same
    page.keyboard.press(correct_key(3))
    expect(page.locator("#message")).to_contain_text("does not answer", timeout=10_000)
    session.close()
    again = TrialSession(folder, stimuli, "anna", 2, 5)
    assert again.current is not None and again.current.number == 3
    with serving(again, port, break_every=100):
        answered(page, 4, total)
        for number in (4, 5):
            press_when_shown(page, correct_key(number))
            page.wait_for_function(f"state.done === {number + 1}")
        expect(page.locator("#message")).to_contain_text("That was the last one")
    table = pd.read_parquet(folder / TABLE)
    assert table["trial"].tolist() == list(range(total)) and table["correct"].all()
    assert table["answer"].tolist() == [given[number] for number in range(total)]
    assert (table["response_s"] > 0.0).all() and (table["display_rate_hz"] > 5.0).all()
    assert table["fits_window"].all() and (table["dropped_frames"] >= 0).all()
    assert not errors
    again.close()
    page.close()


PAIRS = """all => all.map(one => ({
  left: one.getBoundingClientRect().left,
  width: one.getBoundingClientRect().width,
  pixels: one.getContext("2d").getImageData(0, 0, one.width, one.height).data.join(),
}))"""


def test_the_pair_that_differs_is_seen_on_the_side_that_is_right(browser: Browser, tmp_path: Path) -> None:
    stimuli = write_stimuli(tmp_path / "stimuli", frames=1)  # so that what is on the canvases does not change
    page = browser.new_page(viewport={"width": 900, "height": 700})
    with TrialSession(tmp_path / "session", stimuli, "anna", 2, 5) as session, serving(session) as address:
        page.goto(address)
        page.wait_for_function("phase === 'pause'")
        page.keyboard.press("Space")
        for trial in session.trials:
            page.wait_for_function(
                f"phase === 'trial' && state.trial.number === {trial.number} && shown.intervals.length > 1"
            )
            canvases = page.eval_on_selector_all("canvas", PAIRS)
            sides = sorted({canvas["left"] for canvas in canvases})
            seen = [{canvas["pixels"] for canvas in canvases if canvas["left"] == side} for side in sides]
            differing = [side for side, pair in zip(("left", "right"), seen, strict=True) if len(pair) == 2]
            assert differing == ([] if trial.test == trial.reference else [trial.side])
            page.keyboard.press({"left": "ArrowLeft", "right": "ArrowRight"}[trial.side])
        page.wait_for_function("phase === 'end'")
        assert session.table()["correct"].all()
        assert set(session.table()["differing_side"]) == {"left", "right"}
    page.close()


def test_a_stimulus_that_was_damaged_is_said(browser: Browser, tmp_path: Path) -> None:
    stimuli = write_stimuli(tmp_path / "stimuli")
    for frame in stimuli.rglob("*.png"):
        frame.write_bytes(frame.read_bytes() + b"x")
    page = browser.new_page()
    with TrialSession(tmp_path / "session", stimuli, "anna", 2, 5) as session, serving(session) as address:
        page.goto(address)
        page.wait_for_function("phase === 'pause'")
        page.keyboard.press("Space")
        expect(page.locator("#message")).to_contain_text("expected the frames of the manifest", timeout=10_000)
    page.close()


def test_pairs_are_seen_in_turn_where_four_pictures_do_not_fit(browser: Browser, tmp_path: Path) -> None:
    """A window that is too small for two refuses to start; one that is wide enough shows one pair at a time."""
    stimuli = write_stimuli(tmp_path / "stimuli", side=160, frames=1)
    page = browser.new_page(viewport={"width": 300, "height": 300})
    with TrialSession(tmp_path / "session", stimuli, "bert", 2, 0) as session, serving(session) as address:
        page.goto(address)
        expect(page.locator("#message")).to_contain_text("It has 300 x 300 and needs 328 x 176", timeout=10_000)
        page.keyboard.press("Space")
        expect(page.locator("#pairs")).to_be_hidden()
        page.set_viewport_size({"width": 340, "height": 200})
        expect(page.locator("#message")).to_contain_text("in turn", timeout=10_000)
        page.keyboard.press("Space")
        for trial in session.trials[:2]:
            page.wait_for_function(f"phase === 'trial' && state.trial.number === {trial.number}")
            page.wait_for_function("shown.intervals.length > 1")
            page.keyboard.press("ArrowLeft")  # before both pairs were seen: no answer
            seen = []
            for _ in range(2):
                canvases = page.eval_on_selector_all("canvas", PAIRS)
                seen.append({one["pixels"] for one in canvases if one["width"] > 0})
                assert sum(one["width"] > 0 for one in canvases) == 2
                assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
                page.keyboard.press("Space")
            differing = ["left" if len(seen[0]) == 2 else "right"] if trial.test != trial.reference else [trial.side]
            assert differing == [trial.side]
            page.keyboard.press({"left": "ArrowLeft", "right": "ArrowRight"}[trial.side])
            page.wait_for_function(f"state.done === {trial.number + 1}")
        page.set_viewport_size({"width": 600, "height": 500})
        press_when_shown(page, "ArrowLeft")  # the trial that is shown goes on in turn
        page.keyboard.press("Space")
        page.keyboard.press("ArrowLeft")
        expect(page.locator("#message")).to_contain_text("left and right", timeout=10_000)
        page.keyboard.press("Space")
        press_when_shown(page, "ArrowLeft")
        page.wait_for_function("state.done === 4")
        table = session.table()
        assert table["videos"].tolist() == [2, 2, 2, 4] and table["fits_window"].all() and table["correct"][:2].all()
    page.close()


@pytest.mark.parametrize(("width", "scheme"), [(1440, "light"), (1024, "dark"), (390, "light")])
def test_no_rule_of_axe_is_broken(browser: Browser, tmp_path: Path, width: int, scheme: Any) -> None:
    """Neither where the rules of the session are told, nor in a trial."""
    session = TrialSession(tmp_path / "session", write_stimuli(tmp_path / "stimuli"), "anna", 1, 0)
    context = browser.new_context(viewport={"width": width, "height": 800}, color_scheme=scheme, bypass_csp=True)
    page = context.new_page()
    with serving(session, free_port(), break_every=100) as address:
        page.goto(address)
        expect(page.locator("#message")).to_contain_text("Press the")
        for key, shown in (("", "#message"), ("Space", "#pairs")):
            if key:
                page.keyboard.press(key)
            expect(page.locator(shown)).to_be_visible(timeout=10_000)
            found = Axe().run(page)
            assert found.violations_count == 0, found.generate_report()
    context.close()
