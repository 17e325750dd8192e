"""First hits: projected onto the image with the poses of their time, they land on the samples that made them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from torch import Tensor

from renderer.trace import Renderer
from scenes import catalog
from scenes.canonical import OrthographicCamera, PerspectiveCamera
from tests.renderer.builders import batch, driving_scene, grid, look_at, vehicle_scene
from tests.renderer.kernels.test_packets import every_feature
from tsar.projection import project
from tsar.types import FrameletBatch, Hits, Viewpoint

CATALOG = (*catalog.NAMES, "planescene", "spheresscene")
SCENES = {"every feature": every_feature, "driving": driving_scene, "vehicle": vehicle_scene}
PIXELS = 512
"""Side of the picture that distances are measured in."""


@cache
def renderer_of(name: str, packets: bool = True) -> Renderer:
    return Renderer(SCENES[name]() if name in SCENES else catalog.load(name), packets=packets)


def asked(side: int, time_s: float | np.ndarray, samples: int = 16) -> FrameletBatch:
    return replace(batch(grid(side), time_s, samples), hits=True)


def hits_of(renderer: Renderer, wanted: FrameletBatch, aspect: float = 1.0) -> Hits:
    hits = renderer.trace(wanted, aspect).hits
    assert hits is not None
    return hits


def parts(hits: Hits) -> tuple[Tensor, ...]:
    return hits.instance, hits.point, hits.occluder


def distance_px(view: Viewpoint, instance: Tensor, point: Tensor, position: Tensor) -> Tensor:
    """Distance of projected hits from their samples, pixels; infinite for a hit behind the camera."""
    found, depth = project(view, instance, point)
    away = (found - position).abs().amax(dim=-1) * PIXELS
    return torch.where(depth > 0.0, away, torch.inf)


@pytest.mark.parametrize("name", CATALOG)
@pytest.mark.parametrize("time_s", [0.0, 0.37, 0.9])
def test_hits_land_on_their_samples(name: str, time_s: float) -> None:
    renderer, wanted = renderer_of(name), asked(128, time_s)
    hits = hits_of(renderer, wanted)
    assert float(distance_px(renderer.viewpoint(time_s), hits.instance, hits.point, wanted.position).max()) < 1e-3
    if name != "corner-exit":  # its picture is all ground and houses
        assert len(hits.instance.unique()) >= 2 and (hits.instance < 0).any()


@pytest.mark.parametrize("packets", [True, False])
def test_hits_of_samples_of_many_times_land_on_them(packets: bool) -> None:
    """Neighbours differ in their times, so that each packet has all of them."""
    renderer, side, times = renderer_of("driving", packets), 64, (0.05, 0.31, 0.62, 0.77)
    number = np.arange(side * side) % len(times)
    wanted = asked(side, np.array(times)[number])
    hits, number = hits_of(renderer, wanted), torch.as_tensor(number.reshape(-1, 16))
    for k, time_s in enumerate(times):
        of_time = number == k
        part = hits.instance[of_time], hits.point[of_time]
        assert float(distance_px(renderer.viewpoint(time_s), *part, wanted.position[of_time]).max()) < 1e-3


@pytest.mark.parametrize("name", CATALOG)
def test_what_is_seen_earlier_is_met_again_where_it_is_expected(name: str) -> None:
    renderer, time_s, step_s = renderer_of(name), 0.4, 0.02
    before, view = hits_of(renderer, asked(128, time_s)), renderer.viewpoint(time_s + step_s)
    position, depth = project(view, before.instance, before.point)
    inside = ((position >= 0.0) & (position < 1.0)).all(dim=-1)
    assert inside.float().mean() > 0.9
    again = replace(asked(128, time_s + step_s), position=position.clamp(0.0, 1.0 - 1e-6).to(torch.float32))
    after = hits_of(renderer, again)
    assert (after.instance == before.instance)[inside].float().mean() > 0.98
    _, depth_after = project(view, after.instance, after.point)
    met = inside & (after.instance == before.instance) & (before.instance >= 0)
    assert ((depth_after - depth).abs() < 1e-3 * depth)[met].float().mean() > 0.97


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("mixed_times", [False, True])
def test_packets_and_single_samples_meet_the_same(name: str, mixed_times: bool) -> None:
    side = 64
    wanted = asked(side, np.random.default_rng(0).uniform(0.0, 0.8, side * side) if mixed_times else 0.3)
    one, other = (hits_of(renderer_of(name, packets), wanted) for packets in (True, False))
    same = one.instance == other.instance
    assert same.float().mean() > 0.999 and len(one.instance.unique()) > 2
    # the ray's length is known to some 1e-6 of the sizes that are involved, at grazing hits to less
    size = 1.0 + one.point.abs().amax(dim=-1)
    near = (one.point - other.point).abs().amax(dim=-1) < 1e-4 * size
    assert near[same].float().mean() > 0.999


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("packets", [True, False])
@pytest.mark.parametrize("mixed_times", [False, True])
def test_colours_are_the_same_bits_with_hits_and_without(name: str, packets: bool, mixed_times: bool) -> None:
    side, renderer = 48, renderer_of(name, packets)
    wanted = asked(side, np.random.default_rng(0).uniform(0.0, 0.8, side * side) if mixed_times else 0.3)
    with_hits, without = renderer.trace(wanted), renderer.trace(replace(wanted, hits=False))
    assert without.hits is None and with_hits.counters == without.counters
    assert torch.equal(with_hits.color, without.color)


@pytest.mark.parametrize("packets", [True, False])
def test_threads_and_company_do_not_change_a_bit(packets: bool) -> None:
    side = 50  # the last packet is not full
    wanted = asked(side, np.linspace(0.0, 1.0, side * side), 1)
    first, *others = (Renderer(driving_scene(), threads=n, packets=packets).trace(wanted).hits for n in (1, 2, 3))
    for hits in others:
        assert all(torch.equal(*pair) for pair in zip(parts(hits), parts(first), strict=True))
    order = torch.from_numpy(np.random.default_rng(0).permutation(side * side))
    times = wanted.times[order].contiguous()
    shuffled = hits_of(renderer_of("driving", packets), replace(wanted, position=wanted.position[order], time_s=times))
    for other, part in zip(parts(shuffled), parts(first), strict=True):
        assert torch.equal(other, part[order])


def test_a_scene_far_from_the_origin_has_hits_and_poses_in_one_space() -> None:
    near, shift = driving_scene(), np.array([3.0e5, -2.0e5, 1.0e5])

    def moved(thing):
        if thing.track is not None:
            return replace(thing, track=replace(thing.track, translation=thing.track.translation + shift))
        matrix = thing.to_world.copy()
        matrix[:3, 3] += shift
        return replace(thing, to_world=matrix)

    far = replace(near, camera=moved(near.camera), instances=tuple(moved(instance) for instance in near.instances))
    renderer, wanted = Renderer(far), asked(64, 0.3)
    hits = hits_of(renderer, wanted)
    assert float(distance_px(renderer.viewpoint(0.3), hits.instance, hits.point, wanted.position).max()) < 1e-3
    assert (hits.instance == hits_of(renderer_of("driving"), wanted).instance).float().mean() > 0.999


@pytest.mark.parametrize("aspect", [1.6, 0.5])
@pytest.mark.parametrize("kind", ["scaled", "parallel", "lens"])
def test_other_cameras(kind: str, aspect: float) -> None:
    """With a lens, rays through one position differ: their hits land about it, by the circle of confusion."""
    plain, at = driving_scene(), look_at((0.5, 2.0, 6.0), (0.0, 0.5, 0.0))
    if kind == "parallel":
        camera = OrthographicCamera(at, 3.0)
    else:
        scale = np.diag([2.0, 2.0, 2.0, 1.0]) if kind == "scaled" else np.eye(4)
        camera = PerspectiveCamera(at @ scale, 50.0, lens_radius=0.01 if kind == "lens" else 0.0, focal_distance=6.0)
    renderer, wanted = Renderer(replace(plain, camera=camera)), asked(32, 0.3)
    hits = hits_of(renderer, wanted, aspect)
    met = hits.instance >= 0
    view = renderer.viewpoint(0.3, aspect)
    away = distance_px(view, hits.instance[met], hits.point[met], wanted.position[met])
    if kind == "lens":
        assert 0.01 < float(away.max()) < 0.05 * PIXELS
    else:
        assert float(away.max()) < 1e-3


@pytest.mark.parametrize("packets", [True, False])
def test_footprints_are_multiplied_sample_by_sample(packets: bool) -> None:
    """A quarter of a footprint is that of four times the pixels, to the bit."""
    renderer, wanted = renderer_of("driving", packets), batch(grid(64), 0.3, 16)
    quarter = torch.arange(wanted.position.shape[0] * 16).reshape(-1, 16) % 3 == 0
    scale = torch.where(quarter, 0.25, 1.0)
    mixed = renderer.trace(replace(wanted, footprint=scale)).color
    plain, sharp = renderer.trace(wanted).color, renderer.trace(wanted, footprint_px=2048.0).color
    assert torch.equal(mixed, torch.where(quarter[..., None], sharp, plain))
    assert not torch.equal(sharp[quarter], plain[quarter])


@pytest.mark.parametrize("scale", [0.0, -1.0, torch.nan, torch.inf])
def test_footprints_that_are_none_are_refused(scale: float) -> None:
    wanted = batch(grid(4), 0.3, 16)
    footprint = torch.ones(1, 16)
    footprint[0, 5] = scale
    with pytest.raises(ValueError, match="footprint"):
        renderer_of("driving").trace(replace(wanted, footprint=footprint))


def test_no_samples_have_no_hits() -> None:
    hits = hits_of(renderer_of("driving"), replace(batch(np.zeros((0, 2)), 0.0, 16), hits=True))
    assert hits.instance.shape == (0, 16) and hits.point.shape == (0, 16, 3)


@pytest.mark.parametrize("time_s", [np.nan, np.inf])
def test_a_time_that_is_not_finite_has_no_viewpoint(time_s: float) -> None:
    with pytest.raises(ValueError, match="time_s"):
        renderer_of("driving").viewpoint(time_s)
