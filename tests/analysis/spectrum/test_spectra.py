"""Power-spectrum slopes of made-up pictures and framelets, and how pictures are cut and refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from analysis.command.cli import InputError
from analysis.spectrum.options import SpectrumOptions
from analysis.spectrum.run import first_of_each
from analysis.spectrum.spectra import (
    Spectrum,
    fit_slope,
    group_statistics,
    picture_spectrum,
    radial_power,
    spectrum_of,
    squares,
)
from renderer.film.files import write_exr
from tsar.config import ConfigError, TsarConfig


def synthetic(exponent: float, side: int, seed: int = 0, count: int = 1) -> np.ndarray:
    """Planes of random phase with power ``1 / f^exponent``."""
    rng = np.random.default_rng(seed)
    frequency = np.fft.fftfreq(side, 1.0 / side)
    radius = np.maximum(np.hypot(frequency[:, None], frequency), 1.0)
    spectrum = np.fft.fft2(rng.standard_normal((count, side, side))) * radius ** (-exponent / 2.0)
    return np.fft.ifft2(spectrum).real


@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.0, 3.0])
def test_slope_of_a_known_spectrum(exponent: float) -> None:
    slope, _ = fit_slope(radial_power(synthetic(exponent, 128, count=40)))
    assert slope == pytest.approx(-exponent, abs=0.08)


@pytest.mark.parametrize("exponent", [0.0, 2.0])
def test_slope_of_a_stack_of_framelets(exponent: float) -> None:
    slope, _ = fit_slope(radial_power(synthetic(exponent, 16, count=400)))
    assert slope == pytest.approx(-exponent, abs=0.12)


def test_a_ramp_has_no_cross() -> None:
    """Without a window the jump between opposite borders would give a slope of -2 on each axis, so about -3."""
    plane = np.linspace(0.0, 1.0, 128)[:, None] + 1e-4 * synthetic(0.0, 128)[0]
    unwindowed = np.abs(np.fft.fft2(plane)) ** 2
    assert unwindowed[30, 0] > 100.0 * np.median(unwindowed[30, 1:])
    power = radial_power(plane[None])
    assert power[29] < 3.0 * power[50]


def radial_power_slow(planes: np.ndarray) -> np.ndarray:
    """Pixel by pixel, frequency by frequency."""
    side = planes.shape[1]
    hann = [0.5 - 0.5 * np.cos(2 * np.pi * i / side) for i in range(side)]
    window = np.array([[a * b for a in hann] for b in hann])
    place = np.arange(side)
    bins: dict[int, list[float]] = {k: [] for k in range(side)}
    for plane in planes:
        kept = (plane - (plane * window).sum() / window.sum()) * window
        for v in range(-side // 2, side // 2):
            for u in range(-side // 2, side // 2):
                wave = np.exp(-2j * np.pi * (v * place[:, None] + u * place) / side)
                bins[round(np.hypot(u, v))].append(abs((kept * wave).sum()) ** 2 / (window**2).sum())
    return np.array([np.mean(bins[k]) for k in range(1, side // 2 + 1)])


def test_radial_power_against_a_loop() -> None:
    planes = synthetic(1.0, 16, seed=3, count=2) + 5.0
    np.testing.assert_allclose(radial_power(planes), radial_power_slow(planes), rtol=1e-9)


def test_power_does_not_depend_on_the_mean() -> None:
    planes = synthetic(2.0, 32)
    np.testing.assert_allclose(radial_power(planes + 100.0), radial_power(planes), rtol=1e-6, atol=1e-12)


def test_line_of_an_exact_power_law() -> None:
    frequency = np.arange(1, 65, dtype=np.float64)
    power = 7.0 * frequency**-1.5
    power[0] = 1e9  # not in the fit
    assert fit_slope(power) == pytest.approx((-1.5, np.log10(7.0)))
    power[10] = 0.0
    assert np.isnan(fit_slope(power)).all()


def test_every_octave_weighs_the_same() -> None:
    """A break in the last octave, which holds half of the bins, tilts the line by less than without weights."""
    frequency = np.arange(1, 129, dtype=np.float64)
    power = np.where(frequency < 64, frequency**-2.0, 64.0**2 * frequency**-4.0)
    plain = np.polyfit(np.log10(frequency[1:]), np.log10(power[1:]), 1)[0]
    assert plain < fit_slope(power)[0] < -2.0


@pytest.mark.parametrize(
    ("shape", "count", "side"), [((64, 64), 1, 64), ((70, 130), 2, 64), ((300, 33), 9, 32), ((127, 64), 1, 64)]
)
def test_squares(shape: tuple[int, int], count: int, side: int) -> None:
    plane = np.arange(np.prod(shape), dtype=np.float64).reshape(shape)
    cut = squares(plane)
    assert cut.shape == (count, side, side)
    top, left = (shape[0] % side) // 2, (shape[1] % side) // 2
    np.testing.assert_array_equal(cut[0], plane[top : top + side, left : left + side])
    bottom, right = top + shape[0] // side * side, left + shape[1] // side * side
    np.testing.assert_array_equal(cut[-1], plane[bottom - side : bottom, right - side : right])


def test_both_encodings() -> None:
    """A spot a thousand times brighter flattens the linear spectrum far more than the compressed one."""
    grey = np.exp(0.3 * synthetic(2.0, 128)[0] / synthetic(2.0, 128)[0].std())
    grey[60:62, 60:62] = 1000.0
    color = np.repeat(grey[..., None], 3, axis=2).astype(np.float32)
    found = spectrum_of(squares, color, name="a", group="b", source="c")
    assert found.slope < found.slope_linear - 0.5
    linear, _ = fit_slope(radial_power(squares(grey)))
    assert found.slope_linear == pytest.approx(linear, abs=1e-3)


@pytest.mark.parametrize("ending", [".png", ".jpg", ".exr"])
def test_pictures_of_every_format(ending: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    path = tmp_path / f"noise{ending}"
    pixels = rng.random((50, 80, 3))
    if ending == ".exr":
        write_exr(path, torch.from_numpy(pixels).float())
    else:
        Image.fromarray((255 * pixels).astype(np.uint8)).save(path)
    found = picture_spectrum(path, "given")
    assert found.name == path.name and found.power.shape == (16,)
    assert found.slope == pytest.approx(0.0, abs=1.2 if ending == ".jpg" else 0.25)
    assert found.picture is not None and found.picture.shape == (32, 32, 3)


def refused(path: Path, *parts: str) -> None:
    with pytest.raises(InputError) as error:
        picture_spectrum(path, "given")
    message = str(error.value)
    assert str(path) in message and "\n" not in message and all(part in message for part in parts), message


def test_pictures_that_cannot_be_used(tmp_path: Path) -> None:
    refused(tmp_path / "none.png", "found none")
    text = tmp_path / "text.png"
    text.write_text("no picture")
    refused(text, "cannot be read")
    small = tmp_path / "small.png"
    Image.new("RGB", (200, 31)).save(small)
    refused(small, "at least 32 pixels", "200, 31")
    black = tmp_path / "black.png"
    Image.new("RGB", (64, 64)).save(black)
    refused(black, "constant")
    infinite = tmp_path / "infinite.exr"
    write_exr(infinite, torch.full((64, 64, 3), torch.inf))
    refused(infinite, "finite")


def test_statistics_of_groups() -> None:
    power = np.ones(4)
    spectra = [
        Spectrum("", group, "", power, slope, 0.0, slope / 2) for group, slope in (("a", -1), ("b", -4), ("a", -2))
    ]
    found = group_statistics(spectra)
    assert found["a"] == {
        "count": 2,
        "slope": {"mean": -1.5, "least": -2, "greatest": -1},
        "slope_linear": {"mean": -0.75, "least": -1, "greatest": -0.5},
    }
    assert found["b"]["count"] == 1 and found["b"]["slope"]["mean"] == -4


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"inputs": ("car",)}, "inputs"),
        ({"inputs": ()}, "inputs"),
        ({"input": "car"}, "input: expected one of"),
        ({"frames_per_input": 0}, "frames_per_input"),
        ({"samples_per_axis": 17}, "samples_per_axis"),
        ({"ideal_samples": 100}, "ideal_samples"),
        ({"ideal_frames": 4}, "ideal_frames"),
        ({"agreement_samples": 32}, "agreement_samples"),
        ({"agreement_frames": 24}, "agreement_frames"),
        ({"tiles_per_input": 6}, "tiles_per_input"),
        ({"tiles_per_input": 64, "agreement_level": 1}, "tiles_per_input"),
        ({"tile_level": 8}, "tile_level"),
        ({"agreement_level": 9}, "agreement_level"),
        ({"tile_at": (0.5, 1.0)}, "tile_at"),
        ({"tile_index": 1024}, "tile_index"),
        ({"span_s": 0.0}, "span_s"),
        ({"ideal_start_s": 5.8}, "ideal_start_s"),
        ({"tau": 1.0}, "tau"),
        ({"threads": -1}, "threads"),
        ({"tsar": TsarConfig(framelet_side=32)}, "framelet_side"),
    ],
)
def test_bad_options_are_named(change: dict, name: str) -> None:
    with pytest.raises(ConfigError, match=name):
        SpectrumOptions(**change)


def test_parts_and_cycle() -> None:
    assert SpectrumOptions().does("slopes") and SpectrumOptions(only="ideal").does("ideal")
    assert not SpectrumOptions(only="ideal").does("agreement")
    assert SpectrumOptions(tsar=TsarConfig(batch_size=256)).cycle_s() > SpectrumOptions().cycle_s() > 0.0


@pytest.mark.parametrize(("axis", "groups"), [(1, ["frames, 1²"]), (4, ["frames, 1²", "frames, 4²"])])
def test_examples_are_frames_with_the_most_samples(axis: int, groups: list[str]) -> None:
    """With one sample a pixel there is one group of frames; framelets, which follow, have no pictures."""
    assert len(SpectrumOptions(samples_per_axis=axis).sampled) == len(groups)
    picture = np.zeros((4, 4, 3), np.uint8)
    names = [(f"{source} {time}", group, source) for source in ("b", "a") for time in (0, 1) for group in groups]
    blank = {"power": np.ones(4), "slope": -2.0, "slope_linear": -2.0, "offset": 0.0}
    own = [Spectrum(name=name, group=group, source=source, picture=picture, **blank) for name, group, source in names]
    own += [Spectrum(name="b", group="framelets, level 2", source="b", **blank)]
    assert [(one.name, one.group) for one in first_of_each(own)] == [("b 0", groups[-1]), ("a 0", groups[-1])]
