"""The solvers that share density out among elements."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.tsar.response.problems import random_problem
from tsar.choices import SOLVERS
from tsar.morton import interleave
from tsar.response.transport import fill


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


@pytest.mark.parametrize("sign", [1, -1])
def test_a_side_that_gets_all_it_wants_gets_it_to_the_bit(sign):
    """However its sum rounds; some have no more room than they want, and the surplus gives or takes what is missing."""
    g = torch.Generator().manual_seed(5)
    desired = sign * (0.1 + torch.rand(999, generator=g, dtype=torch.float64))
    bound = desired * (0.9 + torch.rand(999, generator=g, dtype=torch.float64)).clamp(min=1.0)
    assert torch.equal(SOLVERS["waterfill"](desired, bound, 2e3, 4e3), desired)
