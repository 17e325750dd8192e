"""New densities of each element from what it was granted."""

from decimal import Decimal, localcontext

import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.tsar.response.problems import BOX, extreme_problem, random_problem
from tsar.choices import SOLVERS
from tsar.response.local import constrain
from tsar.response.mixture import mix, smallest_root
from tsar.types import Errors


def test_no_error_means_no_move():
    zero = torch.zeros(4, dtype=torch.float64)
    a = torch.tensor([0.1, 0.3, 0.5, 1.0], dtype=torch.float64)
    local = constrain(a, a.flip(0), Errors(zero, zero), BOX, 1.0)
    assert not local.active.any() and not local.desired_change.any() and not local.max_change.any()
    b_s, b_t = mix(local, zero, BOX, 0.7)
    assert torch.equal(b_s, a) and torch.equal(b_t, a.flip(0))


@pytest.mark.parametrize("name", SOLVERS)
@given(seed=st.integers(0, 10_000), surplus=st.floats(0.0, 2.0), bias=st.sampled_from([0.0, -1.5, 0.8]))
def test_the_whole_decision_conserves_at_the_extremes(name, seed, surplus, bias):
    """Constraints, transport and mixture: the densities that come out hold what the transport granted, in the box."""
    local = extreme_problem(seed)
    change = SOLVERS[name](local.desired_change, local.max_change, surplus, 2.0)
    b_s, b_t = mix(local, change, BOX, bias)
    assert b_s.min() >= BOX.spatial_min * (1 - 1e-12) and b_s.max() <= 1 + 1e-12
    assert b_t.min() >= BOX.temporal_min * (1 - 1e-12) and b_t.max() <= 1 + 1e-12
    before = local.a_s * local.a_t
    assert torch.allclose(b_s * b_t, before + change, rtol=1e-12, atol=1e-14)
    assert abs(float((b_s * b_t - before - change).sum())) <= 1e-6 * float(change.abs().sum()) + 1e-14


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
def test_quadratic_root_solves_or_reports_zero(a, b, d):
    args = [torch.tensor([v], dtype=torch.float64) for v in (a, b, d)]
    k = float(smallest_root(*args))
    disc = b * b - 4 * a * d
    roots = []
    if a != 0 and disc >= 0:
        roots = [r for r in ((-b - disc**0.5) / (2 * a), (-b + disc**0.5) / (2 * a)) if r >= 0]
    assert k >= 0
    if k > 0 and disc >= 0:
        assert abs(a * k * k + b * k + d) <= 1e-9 * max(1.0, abs(a) * k * k, abs(b) * k)
    if roots and min(abs(a), abs(disc)) > 1e-6 and k < 1e6:
        assert k == pytest.approx(min(roots), rel=1e-4, abs=1e-7)


@given(
    a=st.tuples(st.sampled_from([-1.0, 1.0]), st.floats(-18.0, 0.0)),
    b=st.tuples(st.sampled_from([-1.0, 1.0]), st.floats(-12.0, 0.0)),
    d=st.tuples(st.sampled_from([-1.0, 1.0]), st.floats(-18.0, 0.0)),
)
def test_quadratic_root_over_eighteen_decades_against_fifty_digits(a, b, d):
    a, b, d = (sign * 10.0**exponent for sign, exponent in (a, b, d))
    k = float(smallest_root(*(torch.tensor([v], dtype=torch.float64) for v in (a, b, d))))
    with localcontext(prec=50):
        a, b, d = Decimal(a), Decimal(b), Decimal(d)
        disc = b * b - 4 * a * d
        # Where the two terms of the discriminant cancel, float64 cannot know the root any better than the coefficients.
        assume(abs(disc) >= Decimal("1e-6") * b * b)
        roots = [] if disc < 0 else [(-b + sign * disc.sqrt()) / (2 * a) for sign in (-1, 1)]
        positive = [float(root) for root in roots if root >= 0]
    if positive:
        assert k == pytest.approx(min(positive), rel=1e-9)
    elif disc > 0:
        assert k == 0.0


def test_quadratic_root_at_the_ends():
    def root(a, b, d):
        return float(smallest_root(*(torch.tensor([v], dtype=torch.float64) for v in (a, b, d))))

    assert root(0.0, 0.0, 0.0) == 0.0, "no direction and nothing granted"
    assert root(0.0, 0.5, 0.0) == 0.0 and root(0.3, 0.5, 0.0) == 0.0, "nothing granted"
    assert root(-0.5, 0.0, 0.125) == 0.5, "from the extremum itself"
    assert root(-1.0, 2.0, -1.0) == 1.0, "the double root at the extremum"
    assert root(-1.0, 2.0, -1.0 - 1e-15) == pytest.approx(1.0), "a discriminant that rounding made negative"
    assert root(-1.0, 1.0, 0.75) == 1.5, "past the far crossing, where the change has the other sign"


def test_quadratic_survives_a_vanishing_leading_term():
    """Where eq. 6.55-6.56 cancel: A -> 0 must give -D / B to full precision."""
    for a in (0.0, 1e-300, 1e-18, -1e-17):
        k = smallest_root(*(torch.tensor([v], dtype=torch.float64) for v in (a, 0.37, -0.011)))
        assert float(k) == pytest.approx(0.011 / 0.37, rel=1e-14)


@pytest.mark.parametrize("bias", [-1.5, 0.0, 0.8])
def test_mixture_hits_the_granted_density_inside_the_box(bias):
    for seed in range(20):
        local = random_problem(seed)
        change = SOLVERS["waterfill"](local.desired_change, local.max_change, 0.0, 0.0)
        b_s, b_t = mix(local, change, BOX, bias)
        assert b_s.min() >= BOX.spatial_min * (1 - 1e-12) and b_s.max() <= 1 + 1e-12
        assert b_t.min() >= BOX.temporal_min * (1 - 1e-12) and b_t.max() <= 1 + 1e-12
        assert torch.allclose(b_s * b_t, local.a_s * local.a_t + change, atol=1e-10)


def test_bias_slides_towards_space_or_time():
    local = random_problem(3)
    change = torch.zeros_like(local.a_s)
    plain, _ = mix(local, change, BOX, 0.0)
    more, _ = mix(local, change, BOX, 0.5)
    less, _ = mix(local, change, BOX, -0.5)
    active = local.active
    assert bool((more >= plain).all()) and bool((less <= plain).all())
    assert more[active].mean() > plain[active].mean() > less[active].mean()


@pytest.mark.parametrize(("s", "t"), [(0.1, 0.4), (0.4, 0.1)])
def test_without_granted_density_the_axes_are_still_redistributed(s, t):
    """Trivial transport, opposite errors: the element slides along its iso-product curve (sec. 6.3.1.3)."""
    a_s, a_t = (torch.tensor([v], dtype=torch.float64) for v in (s, t))
    local = constrain(a_s, a_t, Errors(torch.tensor([0.05]).double(), torch.tensor([-0.05]).double()), BOX, 1.0)
    b_s, b_t = mix(local, torch.zeros(1, dtype=torch.float64), BOX, 0.0)
    assert float(b_s * b_t) == pytest.approx(s * t) and float(b_s) > s and float(b_t) < t
    assert float(b_s / b_t) == pytest.approx((s + 0.05) / (t - 0.05))
    full, _ = mix(local, local.desired_change, BOX, 0.0)
    assert float(full) == pytest.approx(s + 0.05), "with everything granted, b is b*"


def test_with_everything_granted_all_get_to_where_they_wanted():
    """Those too that want to go past the greatest product on their way, where the ray has a nearer point of as much."""
    past = 0
    for seed in range(20):
        local = random_problem(seed)
        b_s, b_t = mix(local, local.desired_change, BOX, 0.0)
        assert torch.allclose(b_s, local.a_s + local.k_min * local.m_s, atol=1e-9)
        assert torch.allclose(b_t, local.a_t + local.k_min * local.m_t, atol=1e-9)
        product = local.m_s * local.m_t
        past += int(
            ((product < 0) & (local.k_min * 2 * product < -(local.a_s * local.m_t + local.a_t * local.m_s))).sum()
        )
    assert past > 0
