"""EXR files with layers: what is read back is what was shown, and what the scene says of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from analysis import compare
from analysis.comparison.stills import over
from renderer.guides import render_guides
from renderer.trace import Renderer
from scenes.catalog import load_any

SIDE, RATE_HZ, SECONDS, AXIS = 64, 20.0, 0.4, 2
RUNS = ("tsar", "framed", "thesis")
CHANNELS = {"R", "G", "B", "Z", "normal.X", "normal.Y", "normal.Z", "albedo.R", "albedo.G", "albedo.B"}
CHANNELS |= {"instance", "motion.X", "motion.Y", "age", "samples"}


def layers(path: Path) -> dict[str, np.ndarray]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("layers")
    (folder / "layers").mkdir()
    size = {"resolution_px": SIDE, "batch_size": 4, "reference_rate_hz": RATE_HZ, "reference_samples_per_axis": AXIS}
    compare(
        "fly-by", RUNS, seconds=SECONDS, image_times_s=(0.1, 0.3), layered_stills=2, out=folder / "out",
        references=folder / "references", **size,
    )  # fmt: skip
    return folder / "out" / "layers"


def test_every_picture_has_every_layer_at_evenly_spaced_times(folder: Path) -> None:
    names = {f"{name}-{number:06d}.exr" for name in ("reference", *RUNS) for number in (2, 6)}
    assert {file.name for file in folder.iterdir()} == names
    for name in names:
        found = layers(folder / name)
        assert set(found) == CHANNELS
        assert all(values.shape == (SIDE, SIDE) and values.dtype == np.float32 for values in found.values())


def test_layers_of_the_scene_are_those_of_the_moment(folder: Path) -> None:
    scene, _ = load_any("fly-by")
    renderer = Renderer(scene, "cpu", 1)
    expected = render_guides(renderer, SIDE, SIDE, 6 / RATE_HZ)
    for name in ("reference", *RUNS):
        found = layers(folder / f"{name}-000006.exr")
        assert np.array_equal(found["Z"], expected.depth) and np.array_equal(found["instance"], expected.instance)
        assert np.array_equal(found["normal.Y"], expected.normal[..., 1])
    moved = layers(folder / "reference-000006.exr")
    far = np.hypot(moved["motion.X"], moved["motion.Y"])
    assert np.nanmax(far) > 0.5, "the input moves"


def test_colours_ages_and_counts_are_those_of_the_runs(folder: Path) -> None:
    reference, framed, thesis, tsar = (
        layers(folder / f"{name}-000006.exr") for name in ("reference", "framed", "thesis", "tsar")
    )
    assert (reference["age"] == 0).all() and (reference["samples"] == AXIS**2).all()
    assert (framed["samples"] == 1).all() and np.ptp(framed["age"]) == 0 and framed["age"].min() > 0
    assert np.ptp(thesis["age"]) > 0 and set(np.unique(np.log2(thesis["samples"])) % 2) == {0.0}
    assert (tsar["age"] >= 0).all() and tsar["samples"].min() > 0 and np.ptp(tsar["samples"]) > 0
    for run in (framed, thesis, tsar):
        error = np.mean([(run[one].clip(0, 1) - reference[one].clip(0, 1)) ** 2 for one in "RGB"])
        assert 0 < error < 0.1


def test_parts_are_spread_over_the_pixels_they_cover() -> None:
    import torch

    parts = torch.arange(4.0).reshape(2, 2)
    assert np.array_equal(over(parts, (4, 4)), np.kron(parts.numpy(), np.ones((2, 2))))
    assert np.array_equal(over(torch.full((1, 1), 7.0), (3, 5)), np.full((3, 5), 7.0))


def test_no_moment_is_asked_for_by_default(tmp_path: Path) -> None:
    compare(
        "fly-by", ("framed",), seconds=0.2, resolution_px=64, batch_size=4, out=tmp_path / "out", references=tmp_path
    )
    assert not (tmp_path / "out" / "layers").exists()
