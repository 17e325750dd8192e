"""Pages of a live view: one drives, others watch, and each is told what there is to see."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.live.engine import Engine
from analysis.live.hub import Hub, Watcher
from analysis.live.options import Controls
from analysis.live.overlays import codes
from analysis.live.requests import replay
from analysis.live.turns import Turns
from analysis.metrics.quality import pixel_errors
from analysis.page.video import to_pixels
from scenes.sessions import read_session
from tests.analysis.live.builders import options, until


@pytest.fixture(scope="module")
def engine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Engine]:
    made = Engine(options(right="thesis", out=tmp_path_factory.mktemp("live")))
    yield made
    made.close()


@pytest.fixture
def hub(engine: Engine) -> Iterator[Hub]:
    made = Hub(engine)
    yield made
    engine.rest()


def frame(hub: Hub, watcher: Watcher) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and pictures, as a page takes them apart."""
    data = hub.frame(watcher)
    length = int.from_bytes(data[:4], "little")
    header, at, pictures = json.loads(data[4 : 4 + length]), 4 + length, {}
    for side, facts in header["sides"].items():
        if "bytes" in facts:
            shape = facts["height"], facts["width"], 3
            pictures[side] = np.frombuffer(data, np.uint8, facts["bytes"], at).reshape(shape)
            at += facts["bytes"]
    assert at == len(data)
    return header, pictures


def tell(hub: Hub, watcher: Watcher, asked: str, **more: Any) -> None:
    hub.heard(watcher, json.dumps({"do": asked, **more}))


def shown(hub: Hub, watcher: Watcher) -> dict[str, np.ndarray]:
    """Pictures of both sides, once there are some."""
    found: dict[str, np.ndarray] = {}
    until(lambda: found.update(frame(hub, watcher)[1]) or len(found) == 2)
    return found


def test_the_first_drives_and_others_watch(hub: Hub) -> None:
    first, second = hub.came(), hub.came()
    assert [frame(hub, one)[0]["drives"] for one in (first, second)] == [True, False]
    before = hub.engine.timeline.drive
    tell(hub, second, "turn", left=0.5)
    assert hub.engine.timeline.drive is before, "who watches does not drive"
    tell(hub, first, "go", ahead=1.0)
    assert hub.engine.timeline.drive.moves
    tell(hub, second, "drive")
    assert [frame(hub, one)[0]["drives"] for one in (first, second)] == [False, True]
    assert not hub.engine.timeline.drive.moves, "keys of the page that drove are up"
    tell(hub, second, "go", ahead=1.0)
    hub.left(second)
    assert not hub.engine.timeline.drive.moves and frame(hub, first)[0]["drives"]


def test_it_goes_on_while_a_page_is_open(hub: Hub) -> None:
    assert hub.engine.stands
    one, other = hub.came(), hub.came()
    assert not hub.engine.stands
    hub.left(one)
    assert not hub.engine.stands
    hub.left(other)
    assert hub.engine.stands


def test_pictures_are_sent_once_and_are_those_of_the_displays(hub: Hub) -> None:
    watcher = hub.came()
    shown(hub, watcher)
    hub.engine.rest()
    frame(hub, watcher)
    header, again = frame(hub, watcher)
    assert again == {} and header["sides"]["left"]["name"] == "framed"
    fresh = Watcher(7)
    _, pictures = frame(hub, fresh)
    for side, seen in hub.engine.look().sides.items():
        assert seen is not None
        expected = to_pixels(seen.shown[1].image).astype(int)
        assert np.abs(pictures[side].astype(int) - expected).max() <= 1
    assert header["sides"]["left"]["cycle_ms"] > 0.0 and header["sides"]["left"]["age_ms"] > 0.0


def test_what_a_side_has_worked_counts_the_cycle_that_goes_on(hub: Hub, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else cycles of a tenth of a second give shares of the machine that make more than the whole."""
    watcher, worked = hub.came(), Turns.worked
    shown(hub, watcher)
    hub.engine.rest()
    before, _ = frame(hub, watcher)
    monkeypatch.setattr(Turns, "worked", lambda turns, who: worked(turns, who) + 2.5)
    after, _ = frame(hub, watcher)
    for side in ("left", "right"):
        assert after["sides"][side]["cycles"] == before["sides"][side]["cycles"]
        assert after["sides"][side]["worked_s"] - before["sides"][side]["worked_s"] == pytest.approx(2.5)


def test_codes_are_those_of_the_display_within_one() -> None:
    import torch

    image = torch.cat(
        (torch.linspace(-0.1, 1.2, 3000), torch.logspace(-6, 0, 2997), torch.tensor([torch.nan, torch.inf, 0]))
    )
    image = image.reshape(20, 100, 3)
    apart = codes(image).astype(int) - to_pixels(image).astype(int)
    assert np.abs(apart).max() <= 1 and (apart != 0).mean() < 0.01


def test_every_overlay_of_a_policy_is_drawn(hub: Hub) -> None:
    watcher = hub.came()
    plain = shown(hub, watcher)["right"]
    hub.engine.rest()
    labels = frame(hub, watcher)[0]["sides"]["right"]["overlays"]
    of_thesis = ["tiling by refresh rate", "spatial density", "temporal density", "age of samples"]
    assert labels == ["none", *of_thesis]
    tell(hub, watcher, "strength", value=1.0)
    drawn = []
    for label in labels[1:]:
        tell(hub, watcher, "overlay", side="right", label=label)
        header, pictures = frame(hub, watcher)
        assert header["overlay"]["right"] == label and " to " in header["sides"]["right"]["scale"]
        drawn.append(pictures["right"].tobytes())
        assert pictures["right"].shape == plain.shape
    assert len({*drawn, plain.tobytes()}) == 5


def test_controls_and_the_animation_heed_the_driver(hub: Hub) -> None:
    watcher, timeline = hub.came(), hub.engine.timeline
    tell(hub, watcher, "playing", value=False)
    tell(hub, watcher, "scrub", at_s=1.25)
    tell(hub, watcher, "speed", value=0.5)
    tell(hub, watcher, "repeats", value=False)
    tell(hub, watcher, "ride", value=False)
    header, _ = frame(hub, watcher)
    assert header["animation"]["at_s"] == 1.25 and not header["animation"]["playing"] and not header["rides"]
    assert header["animation"]["speed"] == 0.5 and not header["animation"]["repeats"]
    eye = timeline.drive.eye
    tell(hub, watcher, "step", ahead=0.1)
    assert np.linalg.norm(timeline.drive.eye - eye) == pytest.approx(0.1 * hub.engine.distance)
    tell(hub, watcher, "turn", left=0.2, up=0.1, orbit=True)
    tell(hub, watcher, "reset")
    assert not np.any(timeline.drive.translation) and timeline.drive.rides
    for name, value in (("solver", "square"), ("bias", 1.0), ("latency_cycles", 2)):
        tell(hub, watcher, "set", name=name, value=value)
        assert frame(hub, watcher)[0]["controls"][name] == value
    shown(hub, watcher)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("nonsense", "Expecting value"),
        ("[1]", "message"),
        ('{"do": "dance"}', "do: expected"),
        ("[" * 50_000, "recursion"),
        ('{"do": "turn", "left": "far"}', "left"),
        ('{"do": "turn", "left": NaN}', "left"),
        ('{"do": "go", "ahead": 1e9}', "ahead"),
        ('{"do": "set"}', "expected a field 'name'"),
        ('{"do": "set", "name": "batch_size", "value": 1e999}', "infinity"),
        ('{"do": "set", "name": "bias", "value": 1%s}' % ("0" * 400), "too large"),
        ('{"do": "overlay", "side": "left", "label": "%s"}' % ("x" * 101), "label"),
        ('{"do": "overlay", "side": "left", "label": {}}', "label"),
        ('{"do": "set", "name": "batch_size", "value": 99999}', "batch_size"),
        ('{"do": "set", "name": ["x"], "value": 1}', "unhashable"),
        ('{"do": "overlay", "side": "top", "label": "none"}', "side"),
        ('{"do": "scrub", "at_s": Infinity}', "at_s"),
    ],
)
def test_bad_messages_are_said_and_end_nothing(hub: Hub, text: str, said: str) -> None:
    watcher = hub.came()
    before = hub.engine.timeline.drive, hub.engine.controls
    hub.heard(watcher, text)
    note = frame(hub, watcher)[0]["note"]
    assert said in note and "\n" not in note and frame(hub, watcher)[0]["note"] == ""
    assert before == (hub.engine.timeline.drive, hub.engine.controls)


def test_a_moment_is_held_and_compared_with_the_truth(hub: Hub) -> None:
    watcher = hub.came()
    shown(hub, watcher)
    tell(hub, watcher, "freeze")
    assert hub.engine.stands and hub.frozen is not None
    header, _ = frame(hub, watcher)
    truth = hub.engine.truth()
    for side, seen in hub.engine.look().sides.items():
        assert seen is not None
        errors = header["frozen"]["errors"][side]
        assert errors["mse"] == pytest.approx(pixel_errors(seen.shown[1].image, truth)[0].mse) and errors["mse"] > 0.0
        assert set(errors) == {"mse", "log_mse", "ssim", "flip"}
    assert any(line.startswith("jod") for line in header["frozen"]["missing"])
    assert header["sides"]["left"]["overlays"][-3:] == ["truth", "signed error", "squared error"]
    drawn = {}
    for label in header["sides"]["left"]["overlays"][-3:]:
        tell(hub, watcher, "overlay", side="left", label=label)
        drawn[label] = frame(hub, watcher)[1]["left"]
    assert np.abs(drawn["truth"].astype(int) - to_pixels(truth).astype(int)).max() <= 1
    assert len({one.tobytes() for one in drawn.values()}) == 3
    late = hub.came()
    assert hub.engine.stands, "a page that comes later sees the same moment"
    hub.left(late)
    tell(hub, watcher, "go_on")
    assert not hub.engine.stands and frame(hub, watcher)[0]["overlay"]["left"] == "none"


def test_held_errors_keep_their_names_and_may_be_no_numbers(hub: Hub) -> None:
    watcher = hub.came()
    shown(hub, watcher)
    tell(hub, watcher, "freeze")
    assert hub.frozen is not None
    hub.frozen = replace(hub.frozen, errors={"left": {"mse": math.nan, "ssim": 0.5}})
    tell(hub, watcher, "set", name="right", value="framed-quarter")
    frozen = frame(hub, watcher)[0]["frozen"]
    assert frozen["errors"] == {"left": {"mse": None, "ssim": 0.5}}
    assert frozen["names"] == {"left": "framed", "right": "thesis"}
    hub.engine.change("right", "thesis")


def test_a_moment_that_cannot_be_held_goes_on(hub: Hub, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing() -> None:
        raise RuntimeError("no memory")

    watcher = hub.came()
    monkeypatch.setattr(hub.engine, "truth", failing)
    tell(hub, watcher, "freeze")
    assert frame(hub, watcher)[0]["note"] == "no memory"
    assert hub.frozen is None and not hub.engine.stands


def test_the_replay_is_of_what_was_seen() -> None:
    plain, other = (SimpleNamespace(controls=Controls(bias=bias)) for bias in (0.0, 0.5))
    said = replay(plain, Path("a b.session"), 1.0)  # type: ignore[arg-type]
    assert "run.py 'a b.session' --seconds 0.95" in said and "--bias" not in said
    assert replay(other, Path("a.session"), 1.0).endswith("--bias 0.5")  # type: ignore[arg-type]


def test_what_is_driven_is_saved(hub: Hub) -> None:
    watcher = hub.came()
    tell(hub, watcher, "record")
    tell(hub, watcher, "go", ahead=0.3)
    until(lambda: (frame(hub, watcher)[0]["recording"] or 0.0) > 0.1)
    names = []
    for _ in range(2):
        tell(hub, watcher, "save")
        note = frame(hub, watcher)[0]["note"]
        assert "scripts/run.py" in note and "--rivals framed" in note
        names.append(Path(note.split(" written to ")[1].split(";")[0]))
    assert names[0] != names[1] and names[0].parent == hub.engine.options.out
    assert read_session(names[0]).seconds > 0.1
    hub.engine.timeline.reset()


def test_a_map_that_cannot_be_drawn_leaves_the_picture_and_is_said(hub: Hub) -> None:
    class Broken(dict[str, Any]):
        def __getitem__(self, name: str) -> Any:
            raise RuntimeError("a map of another package")

    watcher = hub.came()
    before = shown(hub, watcher)
    tell(hub, watcher, "freeze")
    run = hub.engine.look().runs["right"]
    assert run is not None
    seen = run.at(hub.engine.now_s)
    assert seen is not None
    record, display = seen.shown
    display = copy.copy(display)
    object.__setattr__(display, "maps", Broken({"broken": 0, "expected error": 0}))
    run._ready[0] = replace(seen, shown=(record, display), number=seen.number + 1)
    tell(hub, watcher, "overlay", side="right", label="broken")
    header, pictures = frame(hub, watcher)
    assert "broken" in header["sides"]["right"]["overlays"] and header["sides"]["right"]["predicted"] is None
    assert header["sides"]["right"]["scale"] == "cannot be drawn (a map of another package)"
    assert pictures["right"].shape == before["right"].shape and frame(hub, watcher)[0]["sides"]["right"]["name"]
    tell(hub, watcher, "go_on")
