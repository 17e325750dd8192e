"""The live view without its page: both sides heed the camera and the controls, and what is recorded is replayed."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch

from analysis.live import camera as cameras
from analysis.live.engine import Engine
from analysis.live.options import Controls, policies
from analysis.live.runner import in_parts
from analysis.metrics.cost_model import CAPACITY_DEFAULT, parameters_of
from analysis.study.runs import Machine, begin
from renderer.trace import Renderer
from scenes import catalog
from scenes.sessions import read_session
from tests.analysis.live.builders import options, until
from tests.scripts.commands import run_script
from tsar.config import ConfigError, TsarConfig
from tsar.policies import POLICIES
from tsar.types import FrameletBatch


@pytest.fixture
def engine() -> Iterator[Engine]:
    made = Engine(options())
    yield made
    made.close()


def pictures(engine: Engine) -> dict[str, torch.Tensor]:
    """What both sides show, once they do."""
    return until(
        lambda: (
            all((sides := engine.look().sides).values())
            and {side: seen.shown[1].image for side, seen in sides.items() if seen is not None}
        )
    )


def numbers(engine: Engine) -> dict[str, int]:
    return {side: seen.number for side, seen in engine.look().sides.items() if seen is not None}


def test_nothing_happens_until_it_is_woken_and_while_it_rests(engine: Engine) -> None:
    assert engine.stands and engine.now_s == 0.0 and not any(engine.look().sides.values())
    engine.wake()
    pictures(engine)
    engine.rest()
    before, time_s = numbers(engine), engine.now_s
    assert engine.now_s == time_s > 0.0 and numbers(engine) == before
    engine.wake()
    until(lambda: all(numbers(engine)[side] > before[side] + 2 for side in before))


def test_both_sides_see_where_the_camera_is(engine: Engine) -> None:
    """What they show of a still scene becomes the picture of the pose that the camera was turned to."""
    engine.timeline.animation.playing = False
    engine.wake()
    before = pictures(engine)
    engine.timeline.change(lambda drive: cameras.turned(drive, 0.4, -0.1))

    def apart() -> dict[str, float]:
        engine.rest()
        truth, shown = engine.truth(), pictures(engine)
        engine.wake()
        return {side: float((shown[side] - truth).square().mean().sqrt()) for side in shown}

    first = {side: float((before[side] - engine_truth(engine)).square().mean().sqrt()) for side in before}
    until(lambda: all(one < 0.5 * first[side] for side, one in apart().items()))


def engine_truth(engine: Engine) -> torch.Tensor:
    engine.rest()
    found = engine.truth()
    engine.wake()
    return found


def test_the_truth_is_that_of_the_scene_as_it_was_driven(engine: Engine, tmp_path: Path) -> None:
    engine.wake()
    engine.timeline.change(lambda drive: dataclasses.replace(drive, velocity=(1.0, 0.0, 5.0), turning=(0.5, 0.0)))
    until(lambda: engine.now_s > 0.3)
    with pytest.raises(ConfigError, match="truth"):
        engine.truth()
    engine.rest()
    shown, now_s = engine.truth(), engine.now_s
    engine.save(tmp_path / "a.session")
    scene, _ = catalog.load_any(tmp_path / "a.session")
    expected = Renderer(scene, threads=1).render_frame(now_s, 64, 64, 3)
    assert float((shown - expected).abs().mean()) < 1e-4
    with pytest.raises(ConfigError, match="one that goes on"):
        engine.wake()
        engine.truth()


def test_controls_begin_anew_what_they_concern(engine: Engine) -> None:
    engine.wake()
    pictures(engine)
    left = engine.look().runs["left"]
    engine.change("right", "thesis")
    assert engine.look().runs["left"] is left, "the other side goes on"
    assert until(lambda: engine.look().sides["right"]).shown[0] is not None, "thesis records its cycles"
    with pytest.raises(ConfigError, match="batch_size"):
        engine.change("batch_size", 100_000)
    assert engine.controls.batch_size == 16
    engine.change("resolution_px", 128)
    assert pictures(engine)["left"].shape == (128, 128, 3) and engine.look().runs["left"] is not left
    engine.change("latency_cycles", 6)
    pictures(engine)
    seen = engine.look().sides["right"]
    assert seen is not None
    display, spent = seen.shown[1], seen.shown[1].spent
    assert spent is not None
    assert display.display_time_s - display.sample_time_s == pytest.approx(6 * spent.cost_s)
    for name, value in (("bias", 0.5), ("solver", "trivial"), ("spatial_slope", -2.0), ("left", "none")):
        engine.change(name, value)
    assert engine.controls == Controls("none", "thesis", 16, 128, 6, spatial_slope=-2.0, bias=0.5, solver="trivial"), (
        "as they were set"
    )
    assert set(engine.look().runs.values()) & {None}


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("right", "nobody", "right"),
        ("right", "oracle", "truth"),
        ("right", "framed", "another policy"),
        ("batch_size", 100_000, "batch_size"),
        ("batch_size", 16.5, "batch_size"),
        ("resolution_px", 100, "resolution_px"),
        ("latency_cycles", 9, "latency_cycles"),
        ("bias", "much", "bias"),
        ("bias", float("nan"), "bias"),
        ("solver", "magic", "solver"),
        ("weather", 1, "control"),
    ],
)
def test_bad_controls_are_refused(name: str, value: object, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        options().controls.changed(name, value)


def test_a_policy_that_fails_leaves_the_other_side(engine: Engine) -> None:
    def broken(setting: object) -> object:
        raise ValueError("no\nsuch luck")

    with POLICIES.lent(broken=broken):  # type: ignore[arg-type]
        engine.wake()
        engine.change("left", "broken")
        run = engine.look().runs["left"]
        assert run is not None and until(lambda: run.error) == "no such luck"
        count = until(lambda: numbers(engine).get("right"))
        until(lambda: numbers(engine).get("right", 0) > count + 2)
        engine.change("left", "none")


def test_every_policy_can_be_seen(engine: Engine) -> None:
    """Of a camera that moves, on the wall clock, without the truth."""
    engine.timeline.change(lambda drive: dataclasses.replace(drive, velocity=(0.0, 0.0, 2.0), turning=(0.2, 0.0)))
    engine.wake()
    engine.change("left", "none")
    engine.change("right", "framed")
    for name in policies():
        engine.change("right", name)
        run = engine.look().runs["right"]
        assert run is not None and until(lambda run=run: run.error or (run.cycles > 2 and engine.look().sides["right"]))
        assert run.error == "" and run.name == name
    assert len(policies()) == len(POLICIES) - 1


def test_parts_of_a_batch_give_the_same_bits() -> None:
    renderer, asked = Renderer(catalog.load("chase"), threads=1), []
    rng = torch.Generator().manual_seed(1)
    level = torch.zeros(7, dtype=torch.int64)
    position = torch.rand(7, 16, 2, generator=rng)
    for time_s, footprint in (
        (0.5, None),
        (torch.rand(7, 16, generator=rng, dtype=torch.float64), position[..., 0] + 0.5),
    ):
        batch = FrameletBatch(level, level, position, time_s, hits=True, footprint=footprint)
        whole = renderer.trace(batch)
        found = in_parts(renderer.trace, batch, 40, lambda: asked.append(1))
        assert torch.equal(found.color, whole.color) and found.counters == whole.counters
        assert found.hits is not None and whole.hits is not None
        for name in ("instance", "point", "occluder"):
            assert torch.equal(getattr(found.hits, name), getattr(whole.hits, name))
    assert len(asked) == 2 * 3, "two framelets a part"


def replayed(scene: str | Path) -> np.ndarray:
    """All that a policy shows, as ``run.py`` runs it."""
    found, config = catalog.load_any(scene)[0], TsarConfig(batch_size=16, resolution_px=64, warmup_cycles=8)
    machine = Machine("thesis", CAPACITY_DEFAULT / 8, parameters_of(config, 4.0))
    renderer = Renderer(found, threads=1)
    run = begin("thesis", config, lambda axis: renderer, machine, (0.0, 0.1))
    return np.stack([display.image.numpy() for _, display in run.images if display.display_time_s > 0.0])


def test_a_session_is_replayed_to_the_same_bits(engine: Engine, tmp_path: Path) -> None:
    engine.wake()
    pictures(engine)
    engine.record()
    engine.timeline.change(lambda drive: dataclasses.replace(drive, velocity=(0.0, 0.0, 4.0), turning=(0.3, 0.0)))
    begin_s = engine.now_s
    until(lambda: engine.now_s > begin_s + 0.25)
    path = tmp_path / "drive.session"
    seconds = engine.save(path)
    assert not engine.recording and 0.2 < seconds < engine.now_s
    session = read_session(path)
    assert session.seen["right"] == "tsar" and session.seconds == pytest.approx(seconds)
    engine.close()
    images = [replayed(path) for _ in range(2)]
    assert images[0].tobytes() == images[1].tobytes()
    assert not np.array_equal(images[0][0], images[0][-1]), "the camera moves"
    assert not np.array_equal(images[0], replayed("chase"))
    assert json.loads(path.read_text())["scene"] == "chase"


PBRT = """
LookAt 0 -5 1  0 0 0  0 0 1
Camera "perspective" "float fov" 40
WorldBegin
LightSource "distant" "point from" [1 -2 3] "point to" [0 0 0] "rgb L" [3 3 3]
Material "matte" "rgb Kd" [0.7 0.3 0.2]
Shape "sphere" "float radius" 0.7
Translate 1 1 0
Shape "sphere" "float radius" 0.5
WorldEnd
"""


def drives(scene: str, folder: Path) -> tuple[Engine, Path]:
    """A live view of any scene after a drive of 0.2 s, and its session."""
    engine = Engine(options(scene, left="none"))
    engine.timeline.animation.repeats = False
    engine.timeline.change(lambda drive: dataclasses.replace(drive, velocity=(0.1, 0.0, 0.2), turning=(0.2, 0.1)))
    engine.timeline.advance(0.2)
    path = folder / "drive.session"
    engine.save(path)
    return engine, path


def test_files_models_and_sessions_are_driven_through(tmp_path: Path) -> None:
    for folder in ("scenes", "first"):
        (tmp_path / folder).mkdir()
    (tmp_path / "scenes/two.pbrt").write_text(PBRT)
    engine, first = drives(str(tmp_path / "scenes/two.pbrt"), tmp_path / "first")
    engine.wake()
    until(lambda: engine.look().sides["right"])
    engine.close()
    assert read_session(first).scene == "../scenes/two.pbrt"
    engine, second = drives(str(first), tmp_path)
    engine.close()
    again = read_session(second)
    assert again.scene == "scenes/two.pbrt" and not np.allclose(
        again.translation[-1], read_session(first).translation[-1]
    )
    scene, _ = catalog.load_any(second)
    assert len(scene.camera.track.translation) == len(again.animation_s)


def test_a_session_of_a_session_has_the_time_of_its_scene(tmp_path: Path) -> None:
    engine = Engine(options("chase", left="none"))
    engine.timeline.animation.speed = 0.5
    engine.timeline.advance(0.4)
    engine.save(tmp_path / "a.session")
    engine.close()
    engine = Engine(options(str(tmp_path / "a.session"), left="none"))
    engine.timeline.advance(0.2)
    engine.save(tmp_path / "b.session")
    engine.close()
    b = read_session(tmp_path / "b.session")
    assert b.scene == "chase" and np.allclose(np.diff(b.animation_s), 0.5 * b.interval_s)


@pytest.mark.slow
def test_run_py_replays_a_session(tmp_path: Path) -> None:
    engine = Engine(options())
    engine.timeline.change(lambda drive: dataclasses.replace(drive, velocity=(0.0, 0.0, 4.0)))
    engine.timeline.advance(0.2)
    engine.save(tmp_path / "drive.session")
    engine.close()
    arguments = ("--seconds", "0.2", "--resolution-px", "64", "--batch-size", "16", "--no-film", "--rivals", "framed")
    digests = []
    for out in ("a", "b"):
        assert run_script("run.py", tmp_path, "drive.session", *arguments, "--out", out).returncode == 0
        digests.append(json.loads((tmp_path / out / "summary.json").read_text())["mse"])
    assert digests[0] == digests[1] and len(digests[0]["tsar"]) == 12
