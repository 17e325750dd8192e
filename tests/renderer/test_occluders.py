"""Occluders of the first light, compared with shadows computed by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from renderer.trace import Renderer
from scenes.canonical import (
    DirectionalLight,
    Emissive,
    Instance,
    Matte,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    RigidTrack,
    Scene,
    Sphere,
)
from tests.renderer.builders import WHITE, look_at, place
from tests.renderer.test_hits import SCENES, asked, hits_of, renderer_of
from tsar.types import FrameletBatch, Hits

FLOOR, STILL, MOVING, WALL, SIGN = range(5)
LIT, UNLIT = -1, -2
RADIUS = 0.5
SPEED = 2.0
"""Of the moving ball along x, scene units per second; at time zero it is above x = -1, z = 0.2."""


def scene(light: DirectionalLight | PointLight) -> Scene:
    """A floor, a ball at rest above (0, 0) and one that passes over it, a wall seen from its dark side, and a sign that
    glows."""
    matte = Matte(WHITE)
    path = RigidTrack(0.0, 1.0, np.array([[-1.0, 0.0, 0.2], [-1.0 + SPEED, 0.0, 0.2]]), np.tile([0.0, 0, 0, 1], (2, 1)))
    flat = (-np.pi / 2, 0.0, 0.0)
    return Scene(
        PerspectiveCamera(look_at((0.0, 5.0, 6.0), (0.0, 0.0, 0.0)), 50.0),
        (
            Instance(Rectangle(), matte, place(axis_angle=flat, scale=(9.0, 9.0, 1.0))),
            Instance(Sphere(RADIUS), matte, place((0.0, 1.0, 0.0))),
            Instance(Sphere(RADIUS), matte, place((0.0, 2.2, 0.0)), path),
            # leans over towards the viewer, so that light from above falls on its back
            Instance(Rectangle(), matte, place((2.6, 0.7, 0.0), (0.4, 0.0, 0.0), (0.5, 0.6, 1.0))),
            Instance(Rectangle(), Emissive((1.0, 1.0, 1.0)), place((-2.6, 0.05, 1.0), flat, (0.4, 0.4, 1.0))),
        ),
        (light, DirectionalLight((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))),
    )


FROM_ABOVE = DirectionalLight((0.0, -1.0, 0.0), (1.0, 1.0, 1.0))


def found(light: DirectionalLight | PointLight, packets: bool, wanted: FrameletBatch) -> Hits:
    return hits_of(Renderer(scene(light), packets=packets), wanted)


@pytest.mark.parametrize("packets", [True, False])
@pytest.mark.parametrize("mixed_times", [False, True])
def test_shadows_on_the_floor_are_those_of_the_balls_above(packets: bool, mixed_times: bool) -> None:
    """Both balls lie in the way of some points: the one at rest is named there."""
    side = 96
    times = np.random.default_rng(0).uniform(0.0, 1.0, side * side) if mixed_times else np.full(side * side, 0.4)
    hits = found(FROM_ABOVE, packets, asked(side, times))
    floor = (hits.instance == FLOOR).reshape(-1)
    x, z = (hits.point.reshape(-1, 3)[:, axis].to(torch.float64) for axis in (0, 2))
    below_still = torch.hypot(x, z) - RADIUS
    below_moving = torch.hypot(x - (torch.as_tensor(times) * SPEED - 1.0), z - 0.2) - RADIUS
    clear = floor & (below_still.abs() > 1e-4) & (below_moving.abs() > 1e-4) & (x.abs() < 1.5)
    expected = torch.where(below_still < 0.0, STILL, torch.where(below_moving < 0.0, MOVING, LIT))
    assert torch.equal(hits.occluder.reshape(-1)[clear], expected[clear].to(torch.int32))
    assert set(expected[clear].tolist()) == {STILL, MOVING, LIT}
    assert ((below_still < 0.0) & (below_moving < 0.0) & clear).any()


@pytest.mark.parametrize("packets", [True, False])
def test_lights_that_are_not_asked(packets: bool) -> None:
    """The dark side of a wall, what glows only, and the sky."""
    hits = found(FROM_ABOVE, packets, asked(96, 0.4))
    for instance in (WALL, SIGN, -1):
        of_it = hits.occluder[hits.instance == instance]
        assert len(of_it) > 10 and (of_it == UNLIT).all(), instance
    lower = (hits.instance == STILL) & (hits.point[..., 1] < 1.0 - 1e-3)
    assert lower.any() and (hits.occluder[lower] == UNLIT).all()
    upper = (hits.instance == MOVING) & (hits.point[..., 1] > 2.2 + 1e-2)
    assert upper.any() and (hits.occluder[upper] == LIT).all()


@pytest.mark.parametrize("packets", [True, False])
def test_what_lies_behind_a_lamp_is_not_in_its_way(packets: bool) -> None:
    """A lamp between the balls: the upper one throws no shadow down."""
    hits = found(PointLight((0.0, 1.6, 0.1), (9.0, 9.0, 9.0)), packets, asked(96, 0.5))
    floor = hits.occluder[hits.instance == FLOOR]
    assert (floor == STILL).any() and (floor == LIT).any() and not (floor == MOVING).any()


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("mixed_times", [False, True])
def test_packets_and_single_samples_find_the_same(name: str, mixed_times: bool) -> None:
    side = 64
    wanted = asked(side, np.random.default_rng(0).uniform(0.0, 0.8, side * side) if mixed_times else 0.3)
    one, other = (hits_of(renderer_of(name, packets), wanted) for packets in (True, False))
    assert (one.occluder == other.occluder).float().mean() > 0.997 and len(one.occluder.unique()) > 2


def test_light_that_arrives_is_dark_where_it_is_occluded() -> None:
    """With one light and no other, black is what has an occluder or is not asked."""
    only = replace(scene(FROM_ABOVE), lights=(FROM_ABOVE,))
    answer = Renderer(only).trace(asked(96, 0.4))
    assert answer.hits is not None
    dark = (answer.color == 0.0).all(dim=-1) | (answer.hits.instance == SIGN)
    assert torch.equal(dark, answer.hits.occluder != LIT)
