"""The whole decision: from errors to densities, cycle after cycle."""

import jaxtyping
import pytest
import torch

from tsar.choices import SOLVERS
from tsar.config import ResponseConfig, TsarConfig
from tsar.response import initial_densities, respond
from tsar.types import Densities, Errors


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
