from decimal import Decimal, localcontext

import jaxtyping
import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st

from tsar.choices import SOLVERS
from tsar.config import ResponseConfig, TsarConfig
from tsar.morton import interleave
from tsar.response import initial_densities, respond
from tsar.response.local import Box, constrain, exit_distance
from tsar.response.mixture import mix, smallest_root
from tsar.response.transport import fill
from tsar.types import Densities, Errors

BOX = Box(spatial_min=1 / 256, temporal_min=1 / 64)


def random_problem(seed, count=256, quiet=0.3):
    g = torch.Generator().manual_seed(seed)

    def uniform(low, high):
        return low + (high - low) * torch.rand(count, generator=g, dtype=torch.float64)

    errors = torch.stack((uniform(-1, 1), uniform(-1, 1)))
    errors[:, torch.rand(count, generator=g) < quiet] = 0.0
    errors[0, :20] = 0.0  # axis-aligned
    errors[1, 20:40] = 0.0
    a_s, a_t = uniform(BOX.spatial_min, 1), uniform(BOX.temporal_min, 1)
    a_s[40:50], a_t[50:60] = BOX.spatial_min, 1.0  # at a wall
    return constrain(a_s, a_t, Errors(errors[0], errors[1]), BOX, 1.0)


def extreme_problem(seed, count=256):
    """Errors and densities over many decades, nearly axis-aligned directions, elements at and close to every wall."""
    g = torch.Generator().manual_seed(seed)

    def decades(low):
        return 10.0 ** (low * torch.rand(count, generator=g, dtype=torch.float64))

    errors = torch.stack((decades(-15), decades(-15))) * torch.sign(torch.randn(2, count, generator=g))
    a_s, a_t = decades(-2.4).clamp(min=BOX.spatial_min), decades(-1.8).clamp(min=BOX.temporal_min)
    a_s[:16], a_s[16:32] = BOX.spatial_min, 1.0
    a_t[8:24], a_t[24:40] = BOX.temporal_min, 1.0
    a_s[40:48], a_t[48:56] = BOX.spatial_min * (1 + 1e-8), 1 - 1e-8
    return constrain(a_s, a_t, Errors(errors[0], errors[1]), BOX, 1.0)


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


def test_no_error_means_no_move():
    zero = torch.zeros(4, dtype=torch.float64)
    a = torch.tensor([0.1, 0.3, 0.5, 1.0], dtype=torch.float64)
    local = constrain(a, a.flip(0), Errors(zero, zero), BOX, 1.0)
    assert not local.active.any() and not local.desired_change.any() and not local.max_change.any()
    b_s, b_t = mix(local, zero, BOX, 0.7)
    assert torch.equal(b_s, a) and torch.equal(b_t, a.flip(0))


@pytest.mark.parametrize("name", SOLVERS)
@given(seed=st.integers(0, 10_000), share=st.floats(0.0, 1.0), ceiling=st.floats(0.0, 5.0), lean=st.floats(-6.0, 6.0))
def test_every_solver_conserves_and_stays_within_bounds(name, seed, share, ceiling, lean):
    local = random_problem(seed)
    # Lean the problem towards one side by up to six decades.
    tilt = torch.where(local.desired_change > 0, 10.0 ** max(lean, 0.0), 10.0 ** max(-lean, 0.0))
    desired, bound = local.desired_change * tilt, local.max_change * tilt
    surplus = share * ceiling
    change = SOLVERS[name](desired, bound, surplus, ceiling)
    scale = float(change.abs().sum()) + ceiling + 1e-30
    assert bool((change * desired >= 0).all())
    assert bool((change.abs() <= bound.abs() * (1 + 1e-12)).all())
    left = surplus - float(change.sum())
    assert -1e-6 * scale <= left <= ceiling + 1e-6 * scale
    if name in ("slow_greater", "square", "descend", "trivial"):
        assert abs(float(change.sum())) <= 1e-6 * scale


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


@given(st.integers(0, 10_000), st.floats(0.0, 1.2))
def test_fill_against_bisection(seed, share):
    g = torch.Generator().manual_seed(seed)
    direction = torch.rand(200, generator=g, dtype=torch.float64) ** 3
    direction[:20] = 0.0
    bound = direction * (1 + 10 * torch.rand(200, generator=g, dtype=torch.float64))
    target = share * float(bound.sum())
    low, high = 0.0, 20.0
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if torch.minimum(middle * direction, bound).sum() < target else (low, middle)
    assert torch.allclose(fill(direction, bound, target), torch.minimum(low * direction, bound), atol=1e-9)


def test_waterfill_is_not_held_back_by_the_elements_at_their_bound():
    """Sec. 6.3.2.4: 97 % of the elements may not be sped up, 3 % may; point e is stuck, waterfill is not."""
    desired = torch.full((100,), 1.0, dtype=torch.float64)
    bound = desired.clone()
    bound[:3] = 50.0
    desired, bound = torch.cat((desired, -desired * 2)), torch.cat((bound, -bound * 4))
    slow = SOLVERS["scale_lesser"](desired, bound, 0.0, 0.0)
    free = SOLVERS["waterfill"](desired, bound, 0.0, 0.0)
    assert slow[:3].tolist() == [1.0] * 3 and free[:3].min() > 20.0
    assert abs(float(free.sum())) < 1e-9


def test_square_favours_large_responses_and_descend_serves_them_first():
    desired = torch.tensor([4.0, 2.0, 1.0, -1.0], dtype=torch.float64)
    bound = desired * 1.5
    square = SOLVERS["square"](desired, bound, 0.0, 0.0)
    assert square[0] / square[1] == pytest.approx(4.0)
    descend = SOLVERS["descend"](desired, bound, 0.0, 0.0)
    assert descend.tolist() == [1.5, 0.0, 0.0, -1.5]


def element(x, y):
    return int(interleave(torch.tensor(x), torch.tensor(y)))


def test_diffusion_serves_the_neighbours_of_what_is_freed():
    """Two asking elements, one beside a patch that frees density, one far from it with quiet elements between."""
    desired = torch.zeros(256, dtype=torch.float64)
    for x in range(1, 5):
        desired[element(x, 3)] = -0.5
    near, far = element(5, 3), element(12, 12)
    desired[near] = desired[far] = 1.0
    change = SOLVERS["diffusion"](desired, 2 * desired, 0.0, 0.0)
    assert change[near] > 0.3 and change[far] == 0.0
    assert float(change.sum()) == pytest.approx(0.0, abs=1e-15)
    assert change[element(4, 3)] < change[element(1, 3)] < 0.0
    assert not change[desired == 0].any()


def test_diffusion_moves_nothing_where_all_want_the_same():
    desired = torch.full((64,), 0.3, dtype=torch.float64)
    assert not SOLVERS["diffusion"](desired, desired, 0.0, 1.0).any()


def test_surplus_serves_those_who_ask_when_nobody_frees():
    desired = torch.tensor([1.0, 3.0], dtype=torch.float64)
    assert SOLVERS["waterfill"](desired, desired, 2.0, 5.0).sum() == pytest.approx(2.0)
    assert SOLVERS["waterfill"](-desired, -desired, 2.0, 5.0).sum() == pytest.approx(-3.0)


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


@pytest.mark.parametrize("sign", [1, -1])
def test_a_side_that_gets_all_it_wants_gets_it_to_the_bit(sign):
    """However its sum rounds; some have no more room than they want, and the surplus gives or takes what is missing."""
    g = torch.Generator().manual_seed(5)
    desired = sign * (0.1 + torch.rand(999, generator=g, dtype=torch.float64))
    bound = desired * (0.9 + torch.rand(999, generator=g, dtype=torch.float64)).clamp(min=1.0)
    assert torch.equal(SOLVERS["waterfill"](desired, bound, 2e3, 4e3), desired)


@pytest.mark.parametrize("name", [n if n == "waterfill" else pytest.param(n, marks=pytest.mark.slow) for n in SOLVERS])
def test_ten_thousand_cycles_do_not_drift(name, monkeypatch):
    # Shapes are checked by the other tests; here the checks would take longer than the decisions.
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    config = TsarConfig(sdf_side=16, resolution_px=128, batch_size=16, response=ResponseConfig(solver=name))
    densities = initial_densities(config)
    g = torch.Generator().manual_seed(11)
    low, high = config.spatial_bounds
    for cycle in range(10_000):
        noise = torch.rand(3, 256, generator=g, dtype=torch.float64)
        drift = 0.3 * torch.sin(torch.tensor(cycle / 500.0))
        batch = noise[2] < 0.4
        errors = Errors(*(torch.where(batch, (2 * noise[i] - 1 + drift).clamp(-1, 1), 0.0) for i in (0, 1)))
        densities = respond(densities, errors, config)
    total = float(densities.combined().sum()) + densities.surplus
    assert abs(total - config.budget) <= 1e-5 * config.budget
    assert 0.0 <= densities.surplus <= config.response.surplus_max * config.budget * (1 + 1e-9)
    assert densities.spatial.min() >= low * (1 - 1e-12) and densities.spatial.max() <= high * (1 + 1e-12)
    assert densities.temporal.min() >= config.response.temporal_min * (1 - 1e-12) and densities.temporal.max() <= 1


@pytest.mark.parametrize("name", SOLVERS)
def test_a_decision_over_a_large_field_does_not_depend_on_the_thread_count(name):
    """More elements than one thread takes on: sums and square roots must not show how they were shared out."""
    config = TsarConfig(sdf_side=256, response=ResponseConfig(solver=name))
    g = torch.Generator().manual_seed(4)
    start = initial_densities(config)
    errors = [Errors(*(2 * torch.rand(2, 256**2, generator=g, dtype=torch.float64) - 1)) for _ in range(2)]
    before, results = torch.get_num_threads(), []
    try:
        for threads in (1, 2, 3):
            torch.set_num_threads(threads)
            densities = start
            for error in errors:
                densities = respond(densities, error, config)
            results.append(densities)
    finally:
        torch.set_num_threads(before)
    for other in results[1:]:
        assert torch.equal(other.spatial, results[0].spatial) and torch.equal(other.temporal, results[0].temporal)
        assert other.surplus == results[0].surplus


def test_the_initial_field_spends_exactly_the_budget():
    for batch, resolution in ((32, 256), (128, 512), (1024, 1024)):
        config = TsarConfig(batch_size=batch, resolution_px=resolution)
        densities = initial_densities(config)
        assert float(densities.combined().sum()) == pytest.approx(config.budget, rel=1e-12)
        low, high = config.spatial_bounds
        assert low <= float(densities.spatial[0]) <= high


def test_elements_outside_the_batch_keep_their_bits():
    config = TsarConfig()
    densities = initial_densities(config)
    errors = torch.zeros(16384, dtype=torch.float64)
    errors[:64] = 0.5
    after = respond(densities, Errors(errors, -errors), config)
    assert torch.equal(after.spatial[64:], densities.spatial[64:])
    assert isinstance(after, Densities)


@pytest.mark.parametrize("field", ["spatial", "temporal"])
def test_densities_of_single_precision_are_no_densities(field: str) -> None:
    """Native code reads them as float64."""
    fields = {"spatial": torch.ones(4, dtype=torch.float64), "temporal": torch.ones(4, dtype=torch.float64)}
    with pytest.raises(jaxtyping.TypeCheckError, match=field):
        Densities(**{**fields, field: torch.ones(4)})
