"""A whole short session in a real browser, with a reload in the middle and a server that dies."""

from __future__ import annotations

import socket
from pathlib import Path

import pandas as pd
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


def test_a_window_that_is_too_small_is_noted(browser: Browser, tmp_path: Path) -> None:
    stimuli = write_stimuli(tmp_path / "stimuli", side=160)
    page = browser.new_page(viewport={"width": 300, "height": 300})
    with TrialSession(tmp_path / "session", stimuli, "bert", 1, 0) as session, serving(session) as address:
        page.goto(address)
        page.wait_for_function("phase === 'pause'")
        page.keyboard.press("Space")
        press_when_shown(page, "ArrowLeft")
        page.wait_for_function("state.done === 1")
        assert not session.table()["fits_window"].iloc[0]
    page.close()
