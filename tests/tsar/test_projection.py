"""Projections of points and directions onto the image, computed by hand."""

import math
from dataclasses import replace

import pytest
import torch

from tsar.projection import project
from tsar.types import Viewpoint

QUARTER_TURN = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], dtype=torch.float64)
VIEW = Viewpoint(
    time_s=0.0,
    track_of_instance=torch.tensor([0, 1]),
    rotation=torch.stack([torch.eye(3, dtype=torch.float64), QUARTER_TURN]),
    translation=torch.tensor([[0.0, 0.0, 0.0], [0.0, 1.0, -4.0]], dtype=torch.float64),
    to_camera=torch.eye(3, dtype=torch.float64),
    to_camera_offset=torch.tensor([0.0, 0.0, -6.0], dtype=torch.float64),
    kind="perspective",
    tan_x=0.5,
    tan_y=0.25,
)
"""The camera stands at z = 6 and looks along -z."""


def seen(instance: int, point: tuple[float, float, float], view: Viewpoint = VIEW) -> tuple[float, float, float]:
    position, depth = project(view, torch.tensor([instance], dtype=torch.int32), torch.tensor([point]))
    return (*position[0].tolist(), float(depth[0]))


def test_a_point_that_stands_still() -> None:
    assert seen(0, (0.0, 0.0, 0.0)) == (0.5, 0.5, 6.0)
    # at depth 4 the image is 4 wide and 2 high
    assert seen(0, (1.0, 0.5, 2.0)) == (0.75, 0.25, 4.0)


def test_a_point_that_moves_is_turned_and_shifted_before() -> None:
    # (1, 0, 2) turns to (0, 1, 2), and is shifted to (0, 2, -2): depth 8, where the image is 4 high
    assert seen(1, (1.0, 0.0, 2.0)) == (0.5, 0.0, 8.0)


def test_what_is_at_infinity_is_seen_by_its_direction_alone() -> None:
    assert seen(-1, (0.25, 0.125, -1.0)) == (0.75, 0.25, math.inf)
    x, y, depth = seen(-1, (0.0, 0.0, 1.0))
    assert math.isnan(x) and math.isnan(y) and depth == -math.inf


@pytest.mark.parametrize("z", [6.0, 8.0])
def test_what_is_not_before_the_camera_has_no_position(z: float) -> None:
    x, y, depth = seen(0, (0.0, 0.0, z))
    assert math.isnan(x) and math.isnan(y) and depth == 6.0 - z


def test_rays_that_are_parallel() -> None:
    view = replace(VIEW, kind="parallel", tan_x=2.0, tan_y=1.0)
    for z in (0.0, 4.0, 8.0):
        assert seen(0, (1.0, 0.5, z), view) == (0.75, 0.25, 6.0 - z)
    assert math.isnan(seen(-1, (0.0, 0.0, -1.0), view)[0])


def test_a_panorama_is_refused() -> None:
    with pytest.raises(ValueError, match="panorama"):
        seen(0, (0.0, 0.0, 0.0), replace(VIEW, kind="panorama"))


def test_any_shape_and_the_same_bits_alone_and_together() -> None:
    point = torch.randn(7, 5, 3, generator=torch.Generator().manual_seed(0))
    instance = torch.arange(35).reshape(7, 5) % 3 - 1
    position, depth = project(VIEW, instance, point)
    assert position.shape == (7, 5, 2) and depth.shape == (7, 5)
    for i in range(7):
        for j in range(5):
            alone, depth_alone = project(VIEW, instance[i, j], point[i, j])
            assert torch.equal(alone.nan_to_num(-9.0), position[i, j].nan_to_num(-9.0))
            assert torch.equal(depth_alone, depth[i, j])
