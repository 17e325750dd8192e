"""What each element wants and how far it can go."""

import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.tsar.response.problems import BOX, extreme_problem, random_problem
from tsar.response.local import constrain, exit_distance
from tsar.types import Errors


def test_exit_distance_of_a_box():
    a = torch.tensor([0.5, 0.5, 0.5, 0.25], dtype=torch.float64)
    m = torch.tensor([1.0, -0.5, 0.0, -1.0], dtype=torch.float64)
    assert exit_distance(a, m, 0.25, 1.0).tolist() == [0.5, 0.5, float("inf"), 0.0]


def test_local_constraints_by_brute_force():
    """k_max leaves the box, and the greatest change of the right sign along the ray is max_change."""
    local = random_problem(1)
    steps = torch.linspace(0, 1, 4001, dtype=torch.float64)[:, None]
    k = steps * local.k_max
    b_s, b_t = local.a_s + k * local.m_s, local.a_t + k * local.m_t
    assert b_s.min() > BOX.spatial_min - 1e-12 and b_s.max() < 1 + 1e-12
    assert b_t.min() > BOX.temporal_min - 1e-12 and b_t.max() < 1 + 1e-12
    past = (local.k_max + 1e-6)[local.active]
    outside_s = (local.a_s + 0 * local.a_s)[local.active] + past * local.m_s[local.active]
    outside_t = local.a_t[local.active] + past * local.m_t[local.active]
    left = (outside_s < BOX.spatial_min) | (outside_s > 1) | (outside_t < BOX.temporal_min) | (outside_t > 1)
    assert bool(left.all())
    change = b_s * b_t - local.a_s * local.a_t
    sign = torch.sign(local.desired_change)
    brute = (change * sign).amax(0) * sign
    assert torch.allclose(local.max_change, brute, atol=1e-6)
    assert bool((local.max_change.abs() >= local.desired_change.abs()).all())
    assert bool((local.max_change * local.desired_change >= 0).all())


def test_an_element_at_a_wall_slides_along_it():
    one, low = torch.ones(1, dtype=torch.float64), torch.full((1,), BOX.spatial_min, dtype=torch.float64)
    half = one * 0.5
    at_ceiling = constrain(one, half, Errors(half, -half), BOX, 1.0)
    assert (float(at_ceiling.m_s), float(at_ceiling.m_t)) == (0.0, -1.0) and float(at_ceiling.k_max) > 0.4
    at_floor = constrain(low, half, Errors(-half, -half), BOX, 1.0)
    assert (float(at_floor.m_s), float(at_floor.m_t)) == (0.0, -1.0)
    inward = constrain(low, half, Errors(half, -half), BOX, 1.0)
    assert float(inward.m_s) > 0.7


@given(st.integers(0, 10_000))
def test_extreme_constraints_stay_in_the_box_and_keep_their_sign(seed):
    local = extreme_problem(seed)
    for k in (local.k_min, local.k_max):
        assert bool((k >= 0).all()) and bool(torch.isfinite(k).all())
        b_s, b_t = local.a_s + k * local.m_s, local.a_t + k * local.m_t
        assert b_s.min() >= BOX.spatial_min * (1 - 1e-12) and b_s.max() <= 1 + 1e-12
        assert b_t.min() >= BOX.temporal_min * (1 - 1e-12) and b_t.max() <= 1 + 1e-12
    assert bool((local.k_min <= local.k_max).all())
    assert bool((local.max_change.abs() >= local.desired_change.abs()).all())
    assert bool((local.max_change * local.desired_change >= 0).all())
