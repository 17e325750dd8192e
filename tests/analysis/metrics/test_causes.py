"""Causes of an image's error on constructed images that have one of them, and sums that must come out exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from analysis.metrics import causes
from analysis.metrics.causes import CAUSES, REGIONS, Truths, carried, flicker, regions_of, split
from analysis.metrics.quality import encode
from tsar.types import SampleMap

SIDE, FRAMELET, RATE, START = 64, 16, 50.0, 2.0
EXACT = 2  # quad level at which samples are a pixel apart


def picture(seed: int, scale: float = 0.3) -> Tensor:
    """Noise about a middle grey, linear."""
    return (0.5 + scale * (torch.rand(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(seed)) - 0.5)).clamp(0, 1)


def truths(images: Sequence[Tensor]) -> Truths:
    return Truths(lambda number: images[number], START, RATE, len(images))


def time_of(number: float) -> float:
    return START + number / RATE


def samples(number: float, level: int = EXACT) -> SampleMap:
    """All of one age and density."""
    return SampleMap(torch.full((1, 1), time_of(number), dtype=torch.float64), torch.full((1, 1), level))


def panned(count: int) -> list[Tensor]:
    """A picture that moves by two pixels from one image to the next."""
    return [picture(1).roll(2 * number, 1) for number in range(count)]


# --- the parts and the whole -----------------------------------------------------------------------------------------


def held_slow(image: Tensor, spacing: int) -> np.ndarray:
    """Box average to samples and straight lines between their centres, one axis after the other."""
    grid = image.double().numpy().reshape(SIDE // spacing, spacing, SIDE // spacing, spacing, 3).mean((1, 3))
    at = np.arange(SIDE) + 0.5
    centres = (np.arange(SIDE // spacing) + 0.5) * spacing
    rows = np.stack([np.interp(at, centres, unit) for unit in np.eye(len(centres))], axis=1)
    return np.einsum("xj,yjc->yxc", rows, np.einsum("yi,ijc->yjc", rows, grid))


def encoded_slow(linear: np.ndarray) -> np.ndarray:
    clipped = linear.clip(0.0, 1.0)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * np.maximum(clipped, 1e-9) ** (1 / 2.4) - 0.055)


@given(st.integers(0, 10_000))
def test_the_parts_add_up_to_the_error(seed: int) -> None:
    rng = np.random.default_rng(seed)
    images = [picture(seed + k).roll(k, 0) if k % 2 else picture(seed) for k in range(6)]
    number = int(rng.integers(0, 6))
    age = torch.from_numpy(rng.choice([time_of(k) for k in range(-3, 6)], (8, 8)))
    level = torch.from_numpy(rng.integers(0, 4, (8, 8)))
    shown = picture(seed + 77, 1.4)
    found = split(shown, SampleMap(age, level), number, truths(images), FRAMELET, step=int(rng.integers(1, 4)))

    known = (age >= START - 1e-9).repeat_interleave(8, 0).repeat_interleave(8, 1)
    assert found.known == pytest.approx(float(known.double().mean()), abs=1e-7)
    whole = (encode(shown) - encode(images[number])).square()
    expected = float(whole.double()[known].mean()) if bool(known.any()) else 0.0
    assert tuple(found.causes) == CAUSES and tuple(found.regions) == tuple(found.share) == REGIONS
    assert found.mse == pytest.approx(expected, rel=1e-6)
    assert sum(found.causes.values()) == pytest.approx(found.mse, abs=1e-12)
    for name in CAUSES:
        assert sum(found.regions[place][name] for place in REGIONS) == pytest.approx(found.causes[name], abs=1e-12)
    assert sum(found.share.values()) == pytest.approx(1.0 if bool(known.any()) else 0.0, abs=1e-12)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_each_part_against_its_definition(seed: int) -> None:
    """Tile by tile in double precision; ages and densities differ from tile to tile."""
    rng = np.random.default_rng(seed)
    images, shown = [picture(seed + k) for k in range(4)], picture(seed + 9)
    number, level = rng.integers(0, 4, (4, 4)), rng.integers(0, 3, (4, 4))
    tiles = SampleMap(START + torch.from_numpy(number).to(torch.float64) / RATE, torch.from_numpy(level))
    found = split(shown, tiles, 3, truths(images), FRAMELET, 1)

    age = number.repeat(16, 0).repeat(16, 1)
    old = np.choose(age[..., None], [image.double().numpy() for image in images])
    spacing = (4 >> level).repeat(16, 0).repeat(16, 1)
    held = np.choose(
        np.log2(spacing).astype(int)[..., None], [held_slow(torch.from_numpy(old), 2**k) for k in range(3)]
    )
    d, b, r_old, r = (encoded_slow(x) for x in (shown.double().numpy(), held, old, images[3].double().numpy()))
    expected = {"aliasing": ((d - b) ** 2).mean(), "blur": ((b - r_old) ** 2).mean(), "lag": ((r_old - r) ** 2).mean()}
    for name, value in expected.items():
        assert found.causes[name] == pytest.approx(value, rel=1e-3, abs=1e-9), name
    mixed = 2 * ((d - b) * (b - r_old) + (b - r_old) * (r_old - r) + (d - b) * (r_old - r)).mean()
    assert found.causes["mixed"] == pytest.approx(mixed, abs=1e-5)


def only(found: causes.Split, name: str, least: float = 1e-4) -> None:
    """Only one cause, and a large one."""
    assert found.known == 1.0 and found.mse > least
    assert found.causes[name] == pytest.approx(found.mse, rel=1e-5)
    others = [value for other, value in found.causes.items() if other != name]
    assert max(map(abs, others)) < 1e-5 * found.mse


@pytest.mark.parametrize("late", [1, 3])
def test_a_late_image_lags_and_nothing_else(late: int) -> None:
    images = panned(6)
    found = split(images[5 - late], samples(5 - late), 5, truths(images), FRAMELET, 1)
    only(found, "lag")
    assert found.mse == pytest.approx(float((encode(images[5]) - encode(images[5 - late])).square().mean()), rel=1e-6)
    assert found.share["moving detailed"] == 1.0


@pytest.mark.parametrize(("level", "spacing"), [(0, 4), (1, 2)])
def test_a_coarsely_sampled_image_is_blurred_and_nothing_else(level: int, spacing: int) -> None:
    images = panned(3)
    shown = torch.from_numpy(held_slow(images[2], spacing)).float()
    only(split(shown, samples(2, level), 2, truths(images), FRAMELET, 1), "blur")


@pytest.mark.parametrize("level", [EXACT, EXACT + 1])
def test_noise_in_samples_of_now_is_aliasing_and_nothing_else(level: int) -> None:
    images = [picture(1)] * 3
    noise = 0.05 * torch.randn(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(2))
    found = split(images[2] + noise, samples(2, level), 2, truths(images), FRAMELET, 1)
    only(found, "aliasing")
    assert found.share["still detailed"] == 1.0
    perfect = split(images[2], samples(2, level), 2, truths(images), FRAMELET, 1)
    assert perfect.mse == 0.0 and set(perfect.causes.values()) == {0.0}


# --- what is known ---------------------------------------------------------------------------------------------------


def test_samples_older_than_the_reference_do_not_count() -> None:
    """They are in a quarter of the image, where it is badly wrong."""
    images = [picture(1)] * 3
    age = torch.full((2, 2), time_of(1), dtype=torch.float64)
    age[0, 1] = time_of(-0.6)
    shown = images[0].clone()
    shown[: SIDE // 2, SIDE // 2 :] = 0.0
    tiles = SampleMap(age, torch.full((2, 2), EXACT))
    found = split(shown, tiles, 2, truths(images), FRAMELET, 1)
    assert (found.known, found.mse) == (0.75, 0.0) and set(found.causes.values()) == {0.0}
    assert sum(found.share.values()) == pytest.approx(1.0), "shares are of what is known"
    age[0, 1] = time_of(-0.4)
    assert split(shown, tiles, 2, truths(images), FRAMELET, 1).mse > 0.01


@pytest.mark.parametrize("time_s", [-np.inf, START - 1.0, time_of(5)])
def test_where_nothing_is_known_nothing_is_claimed(time_s: float) -> None:
    tiles = SampleMap(torch.full((4, 4), time_s, dtype=torch.float64), torch.zeros(4, 4, dtype=torch.int64))
    found = split(picture(3), tiles, 1, truths([picture(1)] * 3), FRAMELET, 1)
    assert (found.known, found.mse) == (0.0, 0.0)
    assert set(found.causes.values()) == set(found.share.values()) == {0.0}


def test_times_go_to_the_nearest_image() -> None:
    found = truths([picture(k) for k in range(4)])
    places = torch.tensor([-9.0, -0.6, -0.4, 0.0, 0.4, 0.6, 2.9, 3.4, 3.6, 99.0], dtype=torch.float64)
    number, known = found.nearest(START + places / RATE)
    assert known.tolist() == [False, False, *[True] * 6, False, False]
    assert number.tolist() == [0, 0, 0, 0, 0, 1, 3, 3, 0, 0]
    for place, expected in zip(places.tolist(), (0, 0, 0, 0, 0, 1, 3, 3, 3, 3), strict=True):
        assert torch.equal(found.at(time_of(place)), picture(expected)), place


def test_a_bounded_number_of_images_is_held() -> None:
    loaded: list[int] = []

    def images(number: int) -> Tensor:
        loaded.append(number)
        return torch.full((2, 2, 3), float(number))

    kept, many = causes._KEPT, causes._KEPT + 20
    found = Truths(images, 0.0, RATE, many)
    for number in range(many):
        assert found.image(number)[0, 0, 0] == number == found.image(number)[0, 0, 0]
    assert loaded == list(range(many)), "each once"
    for number in range(many - kept, many):
        found.image(number)
    assert loaded == list(range(many)), "the newest are held"
    found.image(0)
    assert loaded[many:] == [0], "older ones are not"


# --- density, regions, flicker ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", [EXACT, EXACT + 1, EXACT + 3])
def test_dense_samples_carry_the_image_itself(level: int) -> None:
    image = picture(4)
    assert torch.equal(carried(image, torch.full((4, 4), level), FRAMELET), image)
    assert torch.equal(carried(image, torch.full((4, 4), level - 1), 2 * FRAMELET), image)


def test_each_place_carries_as_much_as_its_density_lets_it() -> None:
    image, level = picture(4), torch.tensor([[0, 1], [2, 0]])
    found = carried(image, level, FRAMELET).numpy()
    half = SIDE // 2
    for (row, column), spacing in (((0, 0), 4), ((0, 1), 2), ((1, 0), 1), ((1, 1), 4)):
        part = np.s_[row * half : (row + 1) * half, column * half : (column + 1) * half]
        assert found[part] == pytest.approx(held_slow(image, spacing)[part], abs=1e-6)


def test_regions_of_a_picture_in_four_quarters() -> None:
    """The right half is striped, the lower half gets brighter; five pixels about a border may be either."""
    now = torch.full((SIDE, SIDE, 3), 0.5)
    now[:, SIDE // 2 :: 2] += 0.1
    before = now.clone()
    before[SIDE // 2 :] -= 0.05
    found, half = regions_of(now, before), SIDE // 2
    for row in (0, 1):
        for column in (0, 1):
            inside = [slice(6, half - 6), slice(half + 6, SIDE)]
            part = found[inside[row], inside[column]]
            assert part.unique().tolist() == [2 * row + column], REGIONS[2 * row + column]
    assert REGIONS[3] == "moving detailed"


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_a_single_pixel_marks_its_surroundings(channel: int) -> None:
    plain = torch.full((SIDE, SIDE, 3), 0.5)
    spot = plain.clone()
    spot[20, 30, channel] += 0.1
    moving = regions_of(plain, spot) == REGIONS.index("moving plain")
    assert moving.nonzero().amin(0).tolist() == [16, 26] and moving.nonzero().amax(0).tolist() == [24, 34]
    assert int(moving.sum()) == 81, "a square of 9"
    detailed = regions_of(spot, spot) == REGIONS.index("still detailed")
    assert int(detailed.sum()) == 121, "the neighbours of the pixel are detailed too"


@pytest.mark.parametrize(("steps", "moves"), [(1.9, False), (2.1, True)])
def test_what_counts_as_motion(steps: float, moves: bool) -> None:
    plain = torch.full((SIDE, SIDE, 3), 0.5)
    assert bool((regions_of(plain + steps / 255, plain) == 2 * moves).all())
    assert bool((regions_of(plain - steps / 255, plain) == 2 * moves).all())


@pytest.mark.parametrize(("steps", "detail"), [(7.9, 0), (8.1, 1)])
def test_what_counts_as_detail(steps: float, detail: int) -> None:
    checks = torch.full((SIDE, SIDE, 3), 0.5)
    checks[::2, ::2] += steps / 255
    assert bool((regions_of(checks, checks) == detail).all())


@pytest.mark.parametrize(("step", "region"), [(1, "still detailed"), (3, "moving detailed"), (99, "moving detailed")])
def test_motion_is_judged_over_the_given_number_of_images(step: int, region: str) -> None:
    """The picture jumps between its third and fourth image and stands still after that."""
    images = [*[picture(1)] * 3, *[picture(2)] * 3]
    found = split(picture(5), samples(5), 5, truths(images), FRAMELET, step)
    assert found.share[region] == 1.0
    assert found.regions[region] == found.causes


def noise(seed: int, deviation: float) -> Tensor:
    return deviation * torch.randn(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("variance", [1e-4, 0.01])
def test_flicker_of_independent_noise_is_its_variance(variance: float) -> None:
    still = picture(1)
    found = flicker(noise(1, variance**0.5), noise(2, variance**0.5), still, still)
    assert found == pytest.approx(variance, rel=0.05)


def test_an_error_that_stays_does_not_flicker_nor_does_what_moves() -> None:
    before = picture(1)
    error = noise(1, 0.1)
    assert flicker(error, error.clone(), before, before) == 0.0
    assert flicker(error, noise(2, 0.1), before + 3 / 255, before) == 0.0
    half = before.clone()
    half[:, : SIDE // 2, 1] += 3 / 255
    inside, outside = (flicker(error, noise(2, 0.1), reference, before) for reference in (half, before))
    assert inside == pytest.approx(outside / 2, rel=0.1), "a share of all pixels, not of those that stand still"
    assert flicker(error, noise(2, 0.1), before + 1 / 255, before) == outside
