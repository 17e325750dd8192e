import pytest
import torch
import torch.nn.functional as F

from tests.oracles import pictures, runs
from tsar.clock import fixed_clock
from tsar.config import TsarConfig
from tsar.policies.resampling import double_width
from tsar.policies.scatter import PixelBuffer, pull_push, write

CONFIG = TsarConfig(batch_size=32, resolution_px=128, warmup_cycles=6)


def play(name, picture, cycles=4, config=CONFIG):
    return list(runs.images(name, config, pictures.tracer(picture), fixed_clock(0.02), 0.0, cycles * 0.02))


@pytest.mark.parametrize("name", ["frameless", "afr", "afr-simple", "interruptible"])
def test_constant_picture_is_shown_exactly_and_runs_repeat(name):
    shown = play(name, pictures.constant)[-1]
    assert torch.allclose(shown.image, torch.full((128, 128, 3), 0.4), atol=1e-5)
    assert shown.display_time_s - shown.sample_time_s == pytest.approx(0.02)
    again = [play(name, pictures.textured_motion)[-1].image for _ in range(2)]
    assert torch.equal(*again) and bool(torch.isfinite(again[0]).all())


@pytest.mark.parametrize("name", ["frameless", "afr", "afr-simple", "framed", "interruptible"])
def test_baselines_do_not_depend_on_the_thread_count(name):
    config = TsarConfig(batch_size=128, warmup_cycles=1)
    before, runs = torch.get_num_threads(), []
    try:
        for threads in (1, 2, 3):
            torch.set_num_threads(threads)
            runs.append(play(name, pictures.textured_motion, 2, config))
    finally:
        torch.set_num_threads(before)
    for other in runs[1:]:
        assert all(torch.equal(a.image, b.image) for a, b in zip(other, runs[0], strict=True))


def test_a_pixel_drawn_twice_keeps_its_last_sample():
    buffer = PixelBuffer.empty(CONFIG)
    color = torch.arange(12.0).reshape(4, 3)
    write(buffer, torch.tensor([7, 3, 7, 3]), color, 0.25)
    assert torch.equal(buffer.color[7], color[2]) and torch.equal(buffer.color[3], color[3])
    assert buffer.time_s.isfinite().nonzero().squeeze(1).tolist() == [3, 7]


def test_frameless_visits_every_pixel_once_a_sweep():
    """A static picture is complete after one sweep: 128² pixels at 32 * 256 a cycle are two cycles."""
    centre = (torch.arange(128) + 0.5) / 128
    exact = pictures.static_stripes(centre[None].expand(128, 128), centre[:, None].expand(128, 128), None)
    assert torch.equal(play("frameless", pictures.static_stripes)[2].image, exact)


def test_pull_push_keeps_known_pixels_and_fills_the_rest():
    color, weight = torch.zeros(3, 32, 32), torch.zeros(1, 32, 32)
    color[:, ::4, ::4], weight[:, ::4, ::4] = 0.7, 1.0
    filled = pull_push(color, weight)
    assert torch.equal(filled[:, ::4, ::4], color[:, ::4, ::4])
    assert torch.allclose(filled, torch.full_like(filled, 0.7), atol=1e-5)


@pytest.mark.parametrize(("height", "width"), [(20, 32), (32, 20), (5, 7), (1, 3)])
def test_pull_push_of_other_shapes_is_the_corner_of_the_least_square_around_them(height: int, width: int):
    random, side = torch.Generator().manual_seed(1), 8 if height == 5 else 4 if height == 1 else 32
    color, weight = torch.rand(3, height, width, generator=random), torch.rand(1, height, width, generator=random)
    weight = weight * (weight > 0.8)
    square, known = torch.zeros(3, side, side), torch.zeros(1, side, side)
    square[:, :height, :width], known[:, :height, :width] = color, weight
    assert torch.equal(pull_push(color, weight), pull_push(square, known)[:, :height, :width])


@pytest.mark.parametrize("shape", [(3, 8, 8), (1, 5, 7), (2, 1, 1), (3, 4, 256)])
def test_double_width_is_bilinear_interpolation(shape):
    plane = torch.randn(shape, generator=torch.Generator().manual_seed(0))
    expected = F.interpolate(plane[None], scale_factor=(1, 2), mode="bilinear", align_corners=False)[0]
    assert double_width(plane).shape == expected.shape == (*shape[:2], 2 * shape[2])
    assert torch.allclose(double_width(plane), expected, rtol=0.0, atol=1e-6)


def map_of(shown):
    assert shown.sample_map is not None
    return shown.sample_map.newest_s, shown.sample_map.level


def pixel_truth(picture, time_s):
    """A picture at the pixel centres, each pixel at a time of its own."""
    centre = (torch.arange(128) + 0.5) / 128
    return picture(centre[None].expand(128, 128), centre[:, None].expand(128, 128), time_s.to(torch.float32))


def test_a_pixel_shows_the_picture_of_the_age_it_claims():
    """Every pixel that has been sampled."""
    displays = play("frameless", pictures.textured_motion, 1)
    ages = set()
    for shown in displays:
        newest_s, level = map_of(shown)
        assert newest_s.shape == level.shape == (128, 128)
        assert bool((level == 3).all()), "128 pixels are 2^3 framelets of 16 samples wide"
        fresh = newest_s == shown.sample_time_s
        assert 0 < int(fresh.sum()) <= CONFIG.budget and float(newest_s.max()) == shown.sample_time_s
        exact = torch.isfinite(newest_s)
        expected = pixel_truth(pictures.textured_motion, newest_s)
        assert torch.allclose(shown.image[exact], expected[exact], atol=1e-6)
        ages |= set(newest_s.unique().tolist())
    assert -torch.inf in ages, "nothing has been sampled everywhere in the first cycle"
    assert ages - {-torch.inf} == {shown.sample_time_s for shown in displays}
    assert len(map_of(displays[-1])[0].unique()) > 1, "of several ages"


def test_maps_of_earlier_images_stay_as_they_were():
    first, *_, last = play("frameless", pictures.constant)
    assert float(map_of(first)[0].max()) == first.sample_time_s < last.sample_time_s


@pytest.mark.parametrize(("per_axis", "level"), [(1, 3), (2, 4)])
def test_a_frame_is_of_one_age_and_density(per_axis, level):
    """128 pixels are 2^3 framelets of 16 samples wide, 256 samples 2^4."""
    name = {1: "framed", 2: "framed-super"}[per_axis]
    for shown in play(name, pictures.textured_motion, 5):
        assert [field.tolist() for field in map_of(shown)] == [[[shown.sample_time_s]], [[level]]]
        expected = pixel_truth(pictures.textured_motion, torch.tensor(shown.sample_time_s))
        assert float((shown.image - expected).abs().mean()) < (1e-6 if per_axis == 1 else 0.02)
