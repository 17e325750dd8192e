"""The live view in a real browser: it shows where one drives, heeds its controls, and outlives its connection."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Iterator

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from analysis.live.engine import Engine
from analysis.live.hub import Hub
from analysis.live.server import watching
from scenes.sessions import read_session
from tests.analysis.live.builders import options, until
from tests.analysis.live.test_engine import replayed
from tests.browser.test_trial_page import free_port

PATIENCE_MS = 60_000
PIXELS = """() => {
  const one = document.getElementById("stage");
  const { data } = one.getContext("2d").getImageData(0, 0, one.width, one.height);
  return Array.from(data.filter((_, i) => i % 44 < 3));
}"""


@pytest.fixture(scope="module")
def engine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Engine]:
    made = Engine(options(out=tmp_path_factory.mktemp("live")))
    made.timeline.animation.playing = False
    yield made
    made.close()


@pytest.fixture
def hub(engine: Engine) -> Iterator[Hub]:
    engine.timeline.reset()
    yield Hub(engine)
    engine.rest()


@pytest.fixture
def page(browser: Browser, hub: Hub) -> Iterator[Page]:
    with watching(hub, "chase") as address:
        context = browser.new_context(viewport={"width": 1180, "height": 900}, bypass_csp=True)
        opened, errors = context.new_page(), []
        opened.on("pageerror", lambda error: errors.append(str(error)))
        opened.goto(address)
        going(opened)
        yield opened
        assert errors == []
        context.close()


def going(page: Page, frames: int = 3) -> None:
    """Waits until the page has drawn so many more frames with both pictures."""
    page.wait_for_function("state && state.sides.left.number && state.sides.right.number", timeout=PATIENCE_MS)
    before = int(page.locator("#live").get_attribute("data-frames") or 0)
    page.wait_for_function(f"Number(live.dataset.frames) >= {before + frames}", timeout=PATIENCE_MS)


def settled(page: Page) -> list[int]:
    """What the stage shows once the runs have seen the camera's new place."""
    cycles = page.evaluate("[state.sides.left.cycles, state.sides.right.cycles]")
    page.wait_for_function(
        f"state.sides.left.cycles > {cycles[0] + 2} && state.sides.right.cycles > {cycles[1] + 10}", timeout=PATIENCE_MS
    )
    return page.evaluate(PIXELS)


def apart(a: list[int], b: list[int]) -> float:
    return sum(abs(x - y) for x, y in zip(a, b, strict=True)) / len(a)


def test_pictures_change_when_the_camera_moves(page: Page, hub: Hub) -> None:
    before = settled(page)
    still = apart(before, settled(page))
    box = page.locator("#stage").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 180, box["y"] + 110, steps=4)
    page.mouse.up()
    until(lambda: apart(before, settled(page)) > 3 * still + 1)
    dragged = settled(page)
    eye = hub.engine.timeline.drive.eye
    page.keyboard.down("w")
    until(lambda: np.linalg.norm(hub.engine.timeline.drive.eye - eye) > 0.2 * hub.engine.distance)
    page.keyboard.up("w")
    until(lambda: not hub.engine.timeline.drive.moves)
    until(lambda: apart(dragged, settled(page)) > 3 * still)
    page.mouse.wheel(0, -100)
    page.locator("#reset").click()
    until(lambda: apart(settled(page), before) < 3 * still + 1)  # where it began


def test_controls_act(page: Page, hub: Hub) -> None:
    engine = hub.engine
    page.locator("#c-right").select_option("thesis")
    expect(page.locator("#right-said")).to_contain_text("thesis", timeout=PATIENCE_MS)
    page.wait_for_function("state.sides.right.number && state.sides.right.name === 'thesis'", timeout=PATIENCE_MS)
    page.locator("#c-bias").focus()
    page.keyboard.press("ArrowRight")
    expect(page.locator("output[for=c-bias]")).to_have_text("0.25", timeout=PATIENCE_MS)
    assert engine.controls.bias == 0.25 and engine.controls.right == "thesis"
    going(page)
    before = settled(page)
    page.locator("#o-right").select_option("spatial density")
    page.locator("#strength").fill("1")
    expect(page.locator("#right-said")).to_contain_text("samples per element", timeout=PATIENCE_MS)
    assert apart(before, settled(page)) > 5
    assert "gradient" in page.locator("#right-key").evaluate("one => getComputedStyle(one).backgroundImage")
    expect(page.locator("#right-key")).to_be_visible()
    expect(page.locator("#left-key")).to_be_hidden()
    page.locator("#c-batch").fill("7")
    expect(page.locator("#note")).to_contain_text("batch_size", timeout=PATIENCE_MS)
    page.locator("#c-batch").blur()
    expect(page.locator("#c-batch")).to_have_value("1")
    expect(page.locator("#c-batch")).to_have_attribute("aria-valuetext", "16")
    expect(page.locator("output[for=c-batch]")).to_have_text("16")
    page.locator("#scrub").fill("1.5")
    expect(page.locator("#at")).to_have_text("1.50 s", timeout=PATIENCE_MS)
    assert engine.timeline.animation.at_s == 1.5
    expect(page.locator("#curve-cycle_ms polyline")).to_have_count(2, timeout=PATIENCE_MS)
    expect(page.locator("#curve-predicted")).to_contain_text("no run here can tell", timeout=PATIENCE_MS)
    page.locator("#playing").click()
    expect(page.locator("#playing")).to_have_text("stop", timeout=PATIENCE_MS)
    page.locator("#stage").focus()
    page.keyboard.press("Space")
    expect(page.locator("#playing")).to_have_text("play", timeout=PATIENCE_MS)
    for name, value in (("right", "tsar"), ("bias", 0.0)):
        engine.change(name, value)


def test_a_moment_is_held_with_its_errors(page: Page, hub: Hub) -> None:
    page.locator("#freeze").click()
    expect(page.locator("#errors tr")).to_have_count(4, timeout=PATIENCE_MS)
    assert hub.engine.stands
    cells = page.locator("#errors tr").first.locator("td")
    assert float(cells.nth(0).inner_text()) > 0.0 and float(cells.nth(1).inner_text()) > 0.0
    caption = page.locator("#frozen caption")
    lines = caption.evaluate("one => one.offsetHeight / parseFloat(getComputedStyle(one).fontSize)")
    assert 1.0 < lines < 2.5, "the caption is one line"
    expect(page.locator("#missing")).to_contain_text("Not taken: jod")
    page.locator("#o-left").select_option("squared error")
    expect(page.locator("#left-said")).to_contain_text("sum over channels", timeout=PATIENCE_MS)
    page.locator("#freeze").click()
    expect(page.locator("#frozen")).to_be_hidden(timeout=PATIENCE_MS)
    assert not hub.engine.stands


def test_the_wipe_and_both_sides(page: Page) -> None:
    expect(page.locator("#wipe")).to_be_visible(timeout=PATIENCE_MS)  # once both sides have pictures
    before = page.evaluate(PIXELS)
    page.locator("#wipe").press("End")
    expect(page.locator("#wipe")).to_have_attribute("aria-valuenow", "100")
    page.locator("#beside").check()
    expect(page.locator("#wipe")).to_be_hidden(timeout=PATIENCE_MS)
    until(lambda: apart(before, page.evaluate(PIXELS)) > 5)  # the stage is drawn with the next frame


def test_a_session_is_saved_and_replays_to_the_same_bits(page: Page, hub: Hub) -> None:
    page.locator("#record").click()
    expect(page.locator("#save")).to_be_visible(timeout=PATIENCE_MS)
    page.locator("#stage").focus()
    page.keyboard.down("ArrowLeft")
    page.wait_for_function("state.recording > 0.25", timeout=PATIENCE_MS)
    page.keyboard.up("ArrowLeft")
    page.locator("#save").click()
    expect(page.locator("#note")).to_contain_text("written to", timeout=PATIENCE_MS)
    (path,) = hub.engine.options.out.glob("*.session")
    assert path.name in page.locator("#note").inner_text() and read_session(path).seconds > 0.2
    hub.engine.rest()
    first, second = replayed(path), replayed(path)
    assert first.tobytes() == second.tobytes() and (first[0] != first[-1]).any()
    assert json.loads(path.read_text())["seen"] == dataclasses.asdict(hub.engine.controls)


def test_two_tabs_do_not_fight(page: Page, hub: Hub) -> None:
    other = page.context.new_page()
    other.goto(page.url)
    going(other)
    expect(other.locator("#status")).to_contain_text("another page drives")
    expect(page.locator("#status")).to_have_text("this page drives; 2 pages are open")
    drive = hub.engine.timeline.drive
    other.locator("#stage").focus()
    other.keyboard.press("ArrowLeft")
    other.mouse.wheel(0, -100)
    assert not other.locator("#freeze").is_enabled() and hub.engine.timeline.drive is drive
    found = Axe().run(other)
    assert found.violations_count == 0, found.generate_report()
    other.locator("#drive").click()
    expect(page.locator("#status")).to_contain_text("another page drives", timeout=PATIENCE_MS)
    expect(other.locator("#drive")).to_be_hidden(timeout=PATIENCE_MS)
    other.close()
    expect(page.locator("#status")).to_have_text("this page drives", timeout=PATIENCE_MS)


def test_a_lost_connection_comes_back(browser: Browser, hub: Hub) -> None:
    """First to the same server, then to one that was begun anew."""
    context, port = browser.new_context(bypass_csp=True), free_port()
    with watching(hub, "chase", port) as address:
        page = context.new_page()
        page.goto(address)
        going(page)
        page.evaluate("socket.close()")
        expect(page.locator("#live")).to_have_attribute("data-state", "lost", timeout=PATIENCE_MS)
        expect(page.locator("#live")).to_have_attribute("data-state", "drives", timeout=PATIENCE_MS)
        going(page)
    expect(page.locator("#status")).to_contain_text("connection lost", timeout=PATIENCE_MS)
    assert hub.engine.stands, "nobody watches"
    with watching(hub, "chase", port):
        expect(page.locator("#live")).to_have_attribute("data-state", "drives", timeout=PATIENCE_MS)
        going(page)
    context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1440, 1024, 390])
def test_no_rule_of_axe_is_broken_and_nothing_is_covered(page: Page, width: int, scheme: str) -> None:
    page.set_viewport_size({"width": width, "height": 900})
    page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    page.evaluate("part('frozen').hidden = false; part('note').hidden = false; part('note').textContent = 'a note'")
    going(page)
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    sizes = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
    assert sizes[0] <= sizes[1] == width


def test_the_server_heeds_its_own_page_alone(hub: Hub) -> None:
    import urllib.error
    import urllib.request

    with watching(hub, "<chase>") as address:
        page = urllib.request.urlopen(address).read().decode()
        assert "&lt;chase&gt;" in page and "<chase>" not in page
        token = re.findall(r'name="token" content="([^"]+)"', page)[0]
        for path, headers, status in (
            ("", {"Host": "example.org"}, 421),
            ("", {"Origin": "http://example.org"}, 403),
            ("watch?token=other", {}, 403),
            (f"watch?token={token}", {"Origin": "http://example.org"}, 403),
            ("live.py", {}, 404),
            ("../options.py", {}, 404),
        ):
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(urllib.request.Request(address + path, headers=headers))
            assert refused.value.code == status, path
    with watching(hub, "chase", host="0.0.0.0") as address:
        bare = address.replace("0.0.0.0", "127.0.0.1")
        assert urllib.request.urlopen(bare).status == 200
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(bare.partition("?")[0])
