"""The report page in a real browser: it loads, the slider moves everything, what is missing is said to be missing."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright

from analysis.page.player import Curve, Player, Step, data
from analysis.page.report import Report, Table, png_bytes, write_report
from analysis.page.video import maps, photographs
from tests.analysis.builders import SCALES, view
from tests.analysis.page.test_report import EVIL

NAMES = ("chromium", "chromium-browser", "google-chrome")
LABELS = [*photographs(view(), 96), *maps(view(), "own", SCALES, 96)]
STEPS, TIMES = 7, 13
LOST, BROKEN = 2, 4
"""Steps at which the second view has no picture, and one that does not decode."""


@dataclass
class Opened:
    """A page and what it said and asked for while it was open."""

    page: Page
    messages: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is on PATH")
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield launched
        launched.close()


def ink(step: int, number: int) -> tuple[int, int, int]:
    """Colour that tells the step and the view."""
    return 30 * step + 10, 20 * number + 5, 99


def picture(step: int, number: int) -> bytes:
    pixels = np.full((64, 64, 3), ink(step, number), np.uint8)
    if number % 2:
        return png_bytes(pixels)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="WEBP", lossless=True)
    return buffer.getvalue()


def player(labels: list[str] = LABELS) -> Player:
    times = np.arange(TIMES)
    steps = [Step(2 * step, {label: picture(step, i) for i, label in enumerate(labels)}) for step in range(STEPS)]
    curves = [
        Curve("thesis", "#c9570c", (1e-3 * 1.3**times).tolist()),
        Curve("framed", "#1f6fb4", np.where(times == 6, 0.0, 2e-2 / 1.2**times).tolist()),
    ]
    ratio = {"thesis / framed": [f"{0.1 * time:.3f}" for time in times]}
    return Player(times / 30, steps, curves, "mean squared error", [0.1, 0.2, 0.3], ratio, "A note on the views.")


def gappy() -> Player:
    """No picture of the second view at one step, and broken ones at another: cut off in its header, and noise."""
    made = player()
    steps = list(made.steps)
    steps[LOST] = Step(steps[LOST].number, {**steps[LOST].pictures, LABELS[1]: None})
    cut, noise = picture(BROKEN, 1)[:20], b"no picture" * 9
    steps[BROKEN] = Step(steps[BROKEN].number, {**steps[BROKEN].pictures, LABELS[1]: cut, LABELS[2]: noise})
    return replace(made, steps=steps)


def report(played: Player | None, text: str = "plain") -> Report:
    wide = Table(text, [text] * 6, [[f"{text} of some length"] * 6], text)
    figure = png_bytes(np.zeros((40, 990, 3), np.uint8))
    details = {text: {"a_long_name": "x" * 300, text: {"in": text}}}
    return Report(text, [text, text], wide, [(text, figure)], played, [wide], details)


@pytest.fixture
def opened(browser: Browser, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Opened]:
    """The page of the report given as parameter, else of the plain one; at the end it has neither failed nor loaded."""
    made = getattr(request, "param", None) or report(player())
    write_report(tmp_path / "report.html", made)
    context = browser.new_context(viewport={"width": 1180, "height": 900})
    found = Opened(context.new_page())
    found.page.on("console", lambda message: found.messages.append(message.text))
    found.page.on("pageerror", lambda error: found.messages.append(str(error)))
    found.page.on("dialog", lambda dialog: found.messages.append(dialog.message) or dialog.dismiss())
    found.page.on("request", lambda request: found.requests.append(request.url))
    address = (tmp_path / "report.html").as_uri()
    found.page.goto(address)
    if made.player:
        shown(found.page, 0)
    yield found
    assert found.messages == []
    assert [url for url in found.requests if not url.startswith("data:")] == [address]
    context.close()


def shown(page: Page, step: int) -> None:
    """Waits until the page shows the step."""
    expect(page.locator("#player")).to_have_attribute("data-step", str(step), timeout=5000)


def move(page: Page, step: int) -> None:
    page.locator("#slider").fill(str(step))
    shown(page, step)


PICTURES = """() => [...document.querySelectorAll('.frame')].map(frame => {
  const image = frame.querySelector('img');
  if (!image) return null;
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 1;
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0, 1, 1);
  return {src: image.src, alt: image.alt, width: image.naturalWidth, seen: image.checkVisibility(),
          ink: [...context.getImageData(0, 0, 1, 1).data].slice(0, 3)};
})"""


def readings(page: Page) -> list[str]:
    return page.locator(".now td.n").all_text_contents()


def cursor_x(page: Page) -> float:
    """Where the cursor is on the screen."""
    box = page.locator("#cursor line").evaluate("line => line.getBoundingClientRect().x")
    return float(box)


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
