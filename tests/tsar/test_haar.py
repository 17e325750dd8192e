import numpy as np
import pytest
import pywt
import torch

from tsar import haar
from tsar.morton import raster_to_morton


def raster(values, side):
    """Morton rows to ``(n, y, x)``."""
    return values[:, raster_to_morton(side)].reshape(-1, side, side)


@pytest.mark.parametrize("side", [16, 32])
def test_first_octave_against_pywavelets(side):
    """One 3D Haar step over (x, y, t): our octants are PyWavelets' times a power of two per filter.

    PyWavelets is orthonormal: low is (a + b) / sqrt 2 = sqrt 2 * ours, high is (a - b) / sqrt 2 = ours / sqrt 2.
    """
    generator = torch.Generator().manual_seed(1)
    before, now = torch.randn(2, 3, side * side, generator=generator, dtype=torch.float64).unbind(0)
    none = torch.zeros(3, haar.state_size(side * side), dtype=torch.float64)
    _, state = haar.transform(before, none, torch.zeros(3, dtype=torch.bool))
    octaves, _ = haar.transform(now, state, torch.ones(3, dtype=torch.bool))
    for n in range(3):
        volume = np.stack([raster(now, side)[n].numpy().T, raster(before, side)[n].numpy().T], axis=2)  # x, y, t
        expected = pywt.dwtn(volume, "haar")
        for octant in ("ghh", "hgh", "ggh", "hhg", "ghg", "hgg", "ggg"):
            ours = raster(getattr(octaves[0], octant), side // 2)[n].numpy().T
            scale = np.prod([np.sqrt(2.0) if f == "h" else np.sqrt(0.5) for f in octant])
            theirs = expected[octant.replace("h", "a").replace("g", "d")][:, :, 0]
            np.testing.assert_allclose(ours * scale, theirs, atol=1e-12)


def test_every_spatial_octave_against_pywavelets():
    """A tile without a past: octave o is a plain 2D multilevel transform."""
    side = 16
    signal = torch.randn(5, side * side, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    octaves, state = haar.transform(signal, torch.zeros(5, 481, dtype=torch.float64), torch.zeros(5, dtype=torch.bool))
    assert state.shape == (5, 481) and len(octaves) == 4
    approximation = raster(signal, side).numpy()
    for o, octave in enumerate(octaves):
        half = side >> (o + 1)
        # PyWavelets names row (y) filters first: cH is low in x.
        low, (low_x_high_y, high_x_low_y, high_both) = pywt.dwt2(approximation, "haar", axes=(1, 2))
        np.testing.assert_allclose(raster(octave.hgh, half).numpy(), low_x_high_y, atol=1e-12)
        np.testing.assert_allclose(raster(octave.ghh, half).numpy(), high_x_low_y, atol=1e-12)
        np.testing.assert_allclose(raster(octave.ggh, half).numpy() / 2, high_both, atol=1e-12)
        approximation = low / 2


def test_perfect_reconstruction_of_a_spatial_step():
    field = torch.randn(4, 64, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    hh, hg, gh, gg = haar.spatial_step(field).chunk(4, dim=1)
    upper_h, lower_h, upper_g, lower_g = hh + hg / 2, hh - hg / 2, gh + gg / 2, gh - gg / 2
    a, b, c, d = upper_h + upper_g / 2, upper_h - upper_g / 2, lower_h + lower_g / 2, lower_h - lower_g / 2
    assert torch.allclose(torch.stack((a, b, c, d), -1).reshape(4, 64), field, atol=1e-12)


def stream(side, frames=40, tiles=2):
    """Random frames through the transform: a frame's signal, octaves, state before and after, and number."""
    generator = torch.Generator().manual_seed(3)
    known = torch.zeros(tiles, dtype=torch.bool)
    state = torch.zeros(tiles, haar.state_size(side * side), dtype=torch.float64)
    for number in range(frames):
        signal = torch.randn(tiles, side * side, generator=generator, dtype=torch.float64)
        octaves, after = haar.transform(signal, state, known)
        yield signal, octaves, state, after, number
        state, known = after, torch.ones_like(known)


@pytest.mark.parametrize("side", [16, 32])
def test_every_octave_in_space_and_time_against_pywavelets(side):
    """Octave o pairs its field with that of 2^o updates ago, once there have been enough of them (fig. 5.9)."""
    past = [[] for _ in range(haar.octave_count(side * side))]
    for signal, octaves, _, _, number in stream(side):
        field = raster(signal, side).numpy()
        for o, octave in enumerate(octaves):
            half = side >> (o + 1)
            known = number >= 2 ** (o + 1) - 1
            assert octave.known.tolist() == [known, known]
            before = past[o][-(2**o)] if known else field
            # Axes n, y, x, t.
            coefficients = pywt.dwtn(np.stack([field, before], axis=3), "haar", axes=(1, 2, 3))
            for octant in ("ghh", "hgh", "ggh", "hhg", "ghg", "hgg", "ggg"):
                scale = np.prod([np.sqrt(2.0) if f == "h" else np.sqrt(0.5) for f in octant])
                x, y, t = octant.replace("h", "a").replace("g", "d")
                ours = raster(getattr(octave, octant), half).numpy() * scale
                np.testing.assert_allclose(ours, coefficients[y + x + t][..., 0], atol=1e-12)
            past[o].append(field)
            field = coefficients["aaa"][..., 0] / np.sqrt(8.0)


def test_the_last_update_of_a_span_is_the_whole_transform_of_it():
    """After 16 updates the coarsest octave has taken in all of them: it is that of a 3D transform of the volume."""
    volume = torch.zeros(16, 16, 16, dtype=torch.float64)  # x, y, t
    for signal, octaves, _, _, number in stream(16, frames=16):
        volume[..., number], coarsest = raster(signal, 16)[0].T, octaves[-1]
    low = volume.numpy()[..., ::-1]  # newest first: high pass is new minus old
    for _ in range(4):
        parts = pywt.dwtn(low, "haar")
        low = parts["aaa"] / np.sqrt(8.0)
    for octant in ("ghh", "hgh", "ggh", "hhg", "ghg", "hgg", "ggg"):
        scale = np.prod([np.sqrt(2.0) if f == "h" else np.sqrt(0.5) for f in octant])
        theirs = parts[octant.replace("h", "a").replace("g", "d")][0, 0, 0]
        assert float(getattr(coarsest, octant)[0, 0]) * scale == pytest.approx(theirs, abs=1e-12)


@pytest.mark.parametrize("side", [16, 32])
def test_perfect_reconstruction_of_all_octaves(side):
    """From the detail octants and the kept state alone, coarse to fine, back to the signal."""
    for signal, octaves, before, after, _ in stream(side):
        first = haar.state_size(side * side) - 1
        approximation = None
        for o in reversed(range(len(octaves))):
            octave = octaves[o]
            positions = octave.ghh.shape[1]
            first -= 4 * positions * 2**o
            if approximation is None:
                now = after[:, first : first + positions]
                oldest = first + 4 * positions * (2**o - 1)
                past = before[:, oldest : oldest + positions]
                approximation = (now + past) / 2 if bool(octave.known.all()) else now
            hh, hg = approximation + octave.hhg / 2, octave.hgh + octave.hgg / 2
            gh, gg = octave.ghh + octave.ghg / 2, octave.ggh + octave.ggg / 2
            upper_h, lower_h, upper_g, lower_g = hh + hg / 2, hh - hg / 2, gh + gg / 2, gh - gg / 2
            cells = (upper_h + upper_g / 2, upper_h - upper_g / 2, lower_h + lower_g / 2, lower_h - lower_g / 2)
            approximation = torch.stack(cells, -1).flatten(1)
        assert torch.allclose(approximation, signal, atol=1e-12)


def test_packing_of_figure_5_15():
    """A 4 x 4 tile: quadrants one after the other, Morton order within; h and g as in eq. 5.15 and 5.16."""
    field = torch.arange(16.0, dtype=torch.float64)[None]
    packed = haar.spatial_step(field)[0]
    assert packed.tolist() == [1.5, 5.5, 9.5, 13.5, -2, -2, -2, -2, -1, -1, -1, -1, 0, 0, 0, 0]


def test_a_static_tile_has_exactly_no_temporal_power():
    signal = torch.rand(2, 256, generator=torch.Generator().manual_seed(5))
    state, known = torch.zeros(2, 481), torch.tensor([False, False])
    for _ in range(20):
        octaves, state = haar.transform(signal, state, known)
        known = torch.tensor([True, True])
    assert all(bool((getattr(o, name) == 0).all()) for o in octaves for name in ("hhg", "ghg", "hgg", "ggg"))
