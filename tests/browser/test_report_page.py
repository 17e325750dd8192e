"""The comparer of the report page in a real browser: time, wipe, errors, loupe, keys, and appearance."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from PIL import Image
from playwright.sync_api import Page, expect

from analysis.page.comparer import Step
from analysis.page.pictures import palette
from tests.analysis.builders import png_bytes
from tests.browser.reports import BROKEN, STEPS, Opened, comparer, gappy, ink, move, report, seen, shown

LEFT, RIGHT = 0.45, 0.55


def near(found: list[int], expected: object, apart: int = 2) -> bool:
    return bool(np.abs(np.array(found) - np.array(expected)).max() <= apart)


def choose(page: Page, side: str, label: str) -> None:
    page.locator(f"#{side}").select_option(label)
    shown_sides(page, side, label)


def shown_sides(page: Page, side: str, label: str) -> None:
    at = {"left": 0, "right": 1}[side]
    page.wait_for_timeout(20)
    expect(page.locator("#comparer")).to_have_attribute("data-shown", _pattern(at, label))


def _pattern(at: int, label: str):
    import re

    return re.compile(rf"^{re.escape(label)} \| " if at == 0 else rf" \| {re.escape(label)}$")


def test_time_and_the_wipe_decide_what_is_seen(opened: Opened) -> None:
    """One picture left of the wipe and the other right of it, of the slider's step, in whole native pixels."""
    page = opened.page
    for step in (0, 3, 6, 1):
        move(page, step)
        assert near(seen(page, LEFT), ink(step, 2)) and near(seen(page, RIGHT), ink(step, 1)), step
        assert page.locator("#time").inner_text() == f"{step / 15:.3f} s"
        assert page.locator("#count").inner_text() == f"{step + 1} of {STEPS}"
    assert page.locator("#zoom").inner_text().endswith(":1")
    box = page.locator("#stage").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 30)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.62 * box["width"], box["y"] + 30)
    page.mouse.up()
    assert near(seen(page, RIGHT), ink(1, 2)), "the left picture reaches beyond"
    page.locator("#wipe").focus()
    page.keyboard.press("Home")
    assert near(seen(page, LEFT), ink(1, 1)) and page.locator("#wipe").get_attribute("aria-valuenow") == "0"
    shown(page, 1)  # arrows of the wipe move no time
    page.locator("#beside").check()
    assert near(seen(page, 0.25), ink(1, 2)) and near(seen(page, 0.75), ink(1, 1))


def test_keys_move_time_hold_the_reference_and_swap(opened: Opened) -> None:
    page = opened.page
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
    page.keyboard.down("r")
    shown_sides(page, "right", "reference")
    assert near(seen(page, LEFT), ink(0, 0)) and near(seen(page, RIGHT), ink(0, 0))
    page.keyboard.up("r")
    shown_sides(page, "right", "tsar")
    page.keyboard.press("x")
    shown_sides(page, "left", "tsar")
    page.locator(".thumb").nth(2).click(modifiers=["Shift"])
    shown_sides(page, "left", "framed")
    page.locator(".thumb").nth(3).click()
    shown_sides(page, "right", "age of samples")
    assert page.locator(".thumb[aria-pressed=true]").count() == 2
    move(page, 3)
    byte = 120
    share = round(255 * (byte - 1) / 254)
    assert near(seen(page, RIGHT), palette("viridis")[share], 3)
    assert page.locator(".scale").nth(1).inner_text().split("\n")[:3] == ["1", "age of samples: ms", "1000"]
    move(page, 0)
    assert near(seen(page, RIGHT), (200, 0, 0)), "no value"


@pytest.mark.parametrize("place", [".thumb >> nth=1", "#fit", "#swap", "#beside", "input[value=signed]", "summary"])
def test_space_and_arrows_are_of_the_page_after_a_click(opened: Opened, place: str) -> None:
    """A control that was clicked has the focus; it has these keys only where the keyboard moved the focus there."""
    page = opened.page
    parts = "#comparer select, #comparer input:not(#slider), details"
    controls = f"[...document.querySelectorAll('{parts}')].map((one) => [one.value, one.checked, one.open])"
    move(page, 2)
    page.locator(place).first.click()
    before = page.evaluate(controls)
    page.keyboard.press("ArrowRight")
    shown(page, 3)
    page.keyboard.press(" ")
    expect(page.locator("#play")).to_have_text("pause")
    page.keyboard.press(" ")
    expect(page.locator("#play")).to_have_text("play")
    assert page.evaluate(controls) == before
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Tab")
    page.keyboard.press(" ")
    expect(page.locator("#play")).to_have_text("play")


def test_errors_have_their_colours_and_the_loupe_their_values(opened: Opened) -> None:
    page = opened.page
    move(page, 3)
    apart = 20 / 255 / 3
    for mode, share in (("signed", (apart + 0.25) / 0.5), ("squared", np.log(3 * apart**2 / 1e-5) / np.log(1e4))):
        page.locator(f"input[value={mode}]").check()
        name = {"signed": "RdBu_r", "squared": "inferno"}[mode]
        expected = palette(name)[round(255 * float(share))]
        page.wait_for_timeout(60)
        assert near(seen(page, RIGHT), expected, 12), mode
    box = page.locator("#stage").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.55 * box["width"], box["y"] + 0.5 * box["height"])
    row = page.locator("#loupe-right td.n")
    expect(row.first).to_have_text(" ".join(map(str, ink(3, 1))))
    assert float(row.nth(1).inner_text()) == pytest.approx(3 * apart**2, rel=0.02)
    page.locator("input[value=picture]").check()
    page.locator("#exposure").fill("1")
    expect(page.locator("#stops")).to_have_text("+1 EV")
    page.wait_for_timeout(60)
    linear = (((100 / 255) + 0.055) / 1.055) ** 2.4 * 2
    assert near(seen(page, RIGHT)[:1], [255 * (1.055 * linear ** (1 / 2.4) - 0.055)])


noise = np.random.default_rng(1).integers(0, 256, (3, 40, 48, 3), dtype=np.uint8)
noise[:, 10:30, 8:20] //= 4
noisy = replace(
    comparer(),
    steps=[Step(0.0, {n: png_bytes(p) for n, p in zip(("reference", "tsar", "framed"), noise, strict=True)})],
)


@pytest.mark.parametrize("opened", [report(noisy)], indirect=True, ids=["noise"])
def test_flip_is_that_of_its_authors(opened: Opened) -> None:
    """Mean and every pixel, against the package flip-evaluator."""
    import flip_evaluator

    found = opened.page.evaluate(
        "([a, b]) => [...Errors.flip(Uint8Array.from(a), Uint8Array.from(b), 48, 40)]",
        [np.dstack((p, np.full((40, 48), 255, np.uint8))).ravel().tolist() for p in noise[1::-1]],
    )
    images = [np.asarray(p, np.float32) / 255 for p in noise[:2]]
    expected, mean, _ = flip_evaluator.evaluate(images[0], images[1], "LDR", inputsRGB=True, applyMagma=False)
    apart = np.abs(np.array(found).reshape(40, 48) - expected[..., 0])
    assert np.mean(found) == pytest.approx(mean, abs=1e-3) and apart.max() < 0.01


def test_zoom_keeps_the_pixel_under_the_cursor(opened: Opened) -> None:
    page = opened.page
    box = page.locator("#stage").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.55 * box["width"], box["y"] + 0.4 * box["height"])
    before = page.locator("#loupe-at").inner_text()
    page.keyboard.press("1")
    expect(page.locator("#zoom")).to_have_text("1:1")
    page.keyboard.press("0")
    fitted = page.locator("#zoom").inner_text()
    page.mouse.wheel(0, -100)
    expect(page.locator("#zoom")).not_to_have_text(fitted)
    page.mouse.move(box["x"] + 0.55 * box["width"] + 0.5, box["y"] + 0.4 * box["height"])
    assert page.locator("#loupe-at").inner_text() == before


def test_curves_share_the_cursor_and_a_click_moves_there(opened: Opened) -> None:
    page, given = opened.page, comparer()
    for step in (1, 5):
        move(page, step)
        places = [page.locator(".cursor").nth(i).get_attribute("transform") for i in range(2)]
        assert places[0] == places[1]
        errors = [curve.values[2 * step] for curve in given.plots[0].curves]
        said = page.locator(".reading").first.inner_text()
        assert [float(part.split()[-1]) for part in said.split(": ")[1].split(", ")] == pytest.approx(errors, rel=6e-3)
    assert page.locator(".reading").nth(1).inner_text().endswith("tracing 3")
    page.locator("svg.plot").nth(1).click(position={"x": 30, "y": 60})
    shown(page, 0)


def test_play_keeps_real_time_and_stops_at_the_end(opened: Opened) -> None:
    """At half of real speed the steps, 6 / 15 s in all, take 0.8 s; the page measures them itself."""
    page = opened.page
    page.locator("#speed").select_option("0.5")
    page.evaluate("""() => { const root = document.getElementById('comparer'); window.seen = [];
      window.began = performance.now();
      new MutationObserver(() => window.seen.push([Number(root.dataset.step), performance.now()]))
        .observe(root, {attributes: true, attributeFilter: ['data-step']}) }""")
    page.keyboard.press("Space")
    expect(page.locator("#play")).to_have_text("pause")
    shown(page, STEPS - 1)
    expect(page.locator("#play")).to_have_text("play")
    steps, times = zip(*page.evaluate("window.seen"), strict=True)
    assert steps[-1] == STEPS - 1 and list(steps) == sorted(set(steps))
    assert times[-1] - page.evaluate("window.began") >= 1e3 * steps[-1] / 15 / 0.5 - 60, "never faster than it says"


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1440, 390])
def test_no_rule_of_axe_is_broken(opened: Opened, width: int, scheme: str) -> None:
    """Names, roles, contrast: in both schemes, with everything unfolded."""
    page = opened.page
    page.set_viewport_size({"width": width, "height": 900})
    page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true })")
    page.locator("input[value=squared]").check()
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()


@pytest.mark.parametrize("width", [1440, 1024, 390])
@pytest.mark.parametrize("opened", [report(gappy()), report(None)], indirect=True, ids=["comparer", "without"])
def test_nothing_is_covered_or_runs_over_the_side(opened: Opened, width: int) -> None:
    page = opened.page
    page.set_viewport_size({"width": width, "height": 900})
    page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true })")
    compared = page.locator("#comparer").count() > 0
    if compared:
        move(page, BROKEN)
    sizes = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
    assert sizes[0] <= sizes[1] == width
    with Image.open(io.BytesIO(page.screenshot())) as screen:
        assert screen.width == width and np.asarray(screen.convert("L")).std() > 5
    covered = page.evaluate("""() => [...document.querySelectorAll('button, select, input, summary')].filter((one) => {
      one.scrollIntoView({block: 'center', inline: 'center'});
      const box = one.getBoundingClientRect();
      const top = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
      return box.width && !one.contains(top) && !one.closest('label')?.contains(top);
    }).map((one) => one.outerHTML.slice(0, 80))""")
    assert covered == []


def test_it_prints_with_tables_unfolded(opened: Opened) -> None:
    page = opened.page
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert page.locator("table").last.is_visible() and not page.locator("#slider").is_visible()
    assert len(page.pdf()) > 10_000
    page.set_viewport_size({"width": 700, "height": 1000})  # A4 between its margins
    page.evaluate("document.querySelector('table td:last-child').textContent = 'f'.repeat(400)")
    assert page.evaluate("document.documentElement.scrollWidth") <= 700, "a long word does not leave the sheet"
    fit = "getComputedStyle(document.querySelector('.stage canvas')).objectFit"
    assert page.evaluate(fit) == "contain", "the sheet has another shape than the window, and the picture keeps its own"
    beyond = "(() => { const one = document.querySelector('.thumbs'); return one.scrollWidth - one.clientWidth })()"
    assert page.evaluate(beyond) <= 0, "all thumbnails are on the sheet"
