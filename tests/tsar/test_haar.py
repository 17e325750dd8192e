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
    octaves, state = haar.transform(signal, torch.zeros(5, 340, dtype=torch.float64), torch.zeros(5, dtype=torch.bool))
    assert state.shape == (5, 340) and len(octaves) == 4
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


def stream(side, frames=4, tiles=3):
    """Random frames through the transform: per frame the signal, the octaves, the state before and after."""
    generator = torch.Generator().manual_seed(3)
    known = torch.zeros(tiles, dtype=torch.bool)
    state = torch.zeros(tiles, haar.state_size(side * side), dtype=torch.float64)
    for _ in range(frames):
        signal = torch.randn(tiles, side * side, generator=generator, dtype=torch.float64)
        octaves, after = haar.transform(signal, state, known)
        yield signal, octaves, state, after, bool(known.all())
        state, known = after, torch.ones_like(known)


@pytest.mark.parametrize("side", [16, 32])
def test_every_octave_in_space_and_time_against_pywavelets(side):
    """Octave o + 1 transforms the low-passed field of octave o against the one it had an update ago (fig. 5.9)."""
    past = [None] * haar.octave_count(side * side)
    for signal, octaves, *_ in stream(side):
        field = raster(signal, side).numpy()
        for o, octave in enumerate(octaves):
            half = side >> (o + 1)
            before = field if past[o] is None else past[o]
            # Axes n, y, x, t.
            coefficients = pywt.dwtn(np.stack([field, before], axis=3), "haar", axes=(1, 2, 3))
            for octant in ("ghh", "hgh", "ggh", "hhg", "ghg", "hgg", "ggg"):
                scale = np.prod([np.sqrt(2.0) if f == "h" else np.sqrt(0.5) for f in octant])
                x, y, t = octant.replace("h", "a").replace("g", "d")
                ours = raster(getattr(octave, octant), half).numpy() * scale
                np.testing.assert_allclose(ours, coefficients[y + x + t][..., 0], atol=1e-12)
            past[o], field = field, coefficients["aaa"][..., 0] / np.sqrt(8.0)


@pytest.mark.parametrize("side", [16, 32])
def test_perfect_reconstruction_of_all_octaves(side):
    """From the detail octants and the cached state alone, coarse to fine, back to the signal."""
    for signal, octaves, before, after, known in stream(side):
        first = haar.state_size(side * side)
        approximation = None
        for octave in reversed(octaves):
            positions = octave.ghh.shape[1]
            first -= 4 * positions
            if approximation is None:
                now = after[:, first : first + positions]
                approximation = (now + before[:, first : first + positions]) / 2 if known else now
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


def test_streaming_recursion_over_many_frames():
    """Octave o + 1 takes the hhh of octave o, paired with the cached field of the same octave."""
    generator = torch.Generator().manual_seed(7)
    frames = torch.randn(6, 1, 16, generator=generator, dtype=torch.float64)
    state, known = torch.zeros(1, haar.state_size(16), dtype=torch.float64), torch.tensor([False])
    first, second = None, None
    for frame in frames:
        octaves, state = haar.transform(frame, state, known)
        known = torch.tensor([True])
        now = haar.spatial_step(frame)
        low = now if first is None else (now + first) / 2
        coarse = haar.spatial_step(low[:, :4])
        past = coarse if second is None else second
        assert torch.allclose(octaves[0].hhg, now[:, :4] - (now if first is None else first)[:, :4])
        assert torch.allclose(octaves[1].hhg, coarse[:, :1] - past[:, :1])
        first, second = now, coarse


def test_a_static_tile_has_exactly_no_temporal_power():
    signal = torch.rand(2, 256, generator=torch.Generator().manual_seed(5))
    state, known = torch.zeros(2, 340), torch.tensor([False, False])
    for _ in range(3):
        octaves, state = haar.transform(signal, state, known)
        known = torch.tensor([True, True])
    assert all(bool((getattr(o, name) == 0).all()) for o in octaves for name in ("hhg", "ghg", "hgg", "ggg"))
