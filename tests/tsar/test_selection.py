import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles.batches import make_batch
from tests.oracles.curves import prefix_sum, tile_integral
from tsar.config import TilingConfig, TsarConfig
from tsar.morton import interleave
from tsar.selection import initial_history, sample_positions, select
from tsar.tiling import build, tile_of_element, uniform


def run(density, cycles, config):
    tiling, history = uniform(4), initial_history(config)
    counts = torch.zeros(tiling.tile_count, dtype=torch.int64)
    for _ in range(cycles):
        selected, history = select(tiling, density, history, config)
        assert selected.numel() == config.batch_size and selected.unique().numel() == config.batch_size
        counts[selected] += 1
    return counts


def test_refresh_rates_follow_the_temporal_density():
    config = TsarConfig(batch_size=64)
    density = torch.full((16384,), 0.1, dtype=torch.float64)
    density[: 16384 // 4] = 0.7  # sums to 256 * (0.7 / 4 + 0.1 * 3 / 4) = 64 tiles a cycle
    counts = run(density, 400, config).to(torch.float64) / 400
    assert abs(counts[:64].mean() - 0.7) < 0.04 and abs(counts[64:].mean() - 0.1) < 0.02


def test_no_tile_starves_however_much_falls_due():
    config = TsarConfig(batch_size=16)
    density = torch.full((16384,), 1.0, dtype=torch.float64)
    density[-64:] = 1.0 / 64.0  # one quiet tile among 255 that ask for every cycle
    assert run(density, 1200, config).min() >= 1


@given(seed=st.integers(0, 10_000), batch=st.sampled_from([5, 32, 64]), decades=st.floats(0.0, 6.0))
def test_no_element_starves_and_every_batch_is_full_under_changing_tilings(seed, batch, decades):
    """Another tiling every cycle and densities between 1/4 and 1: every element is rendered, again and again."""
    config = TsarConfig(batch_size=batch, tiling=TilingConfig(tile_count_max=4 * max(batch, 64)))
    g = torch.Generator().manual_seed(seed)
    temporal = 0.25 + 0.75 * torch.rand(16384, generator=g, dtype=torch.float64)
    history, waited = initial_history(config), torch.zeros(16384, dtype=torch.int64)
    for _ in range(30):
        coarse = 10.0 ** (torch.rand(256, generator=g, dtype=torch.float64) * decades)
        tiling = build(coarse.repeat_interleave(64), config)
        selected, history = select(tiling, temporal, history, config)
        assert selected.unique().numel() == selected.numel() == batch
        rendered = torch.zeros(tiling.tile_count, dtype=torch.bool).index_fill_(0, selected, True)
        waited = torch.where(rendered[tile_of_element(tiling, 7)], 0, waited + 1)
        assert bool(torch.isfinite(history).all())
        if batch == 64:
            assert int(waited.max()) <= 24


def test_elements_are_refreshed_alike_while_tiles_change_their_size():
    """Coarse and fine tilings in turn: the field remembers, so no element gains or loses by being re-tiled."""
    config = TsarConfig(batch_size=32)
    density, history = torch.full((16384,), 0.3125, dtype=torch.float64), initial_history(config)
    counts = torch.zeros(16384, dtype=torch.int64)
    for cycle in range(240):
        tiling = uniform(3 + cycle % 2)
        selected, history = select(tiling, density, history, config)
        counts += torch.isin(tile_of_element(tiling, 7), selected)
    assert float(counts.double().mean()) == 240 * 0.3125 and int(counts.max() - counts.min()) <= 4


@pytest.mark.parametrize("seed", range(3))
def test_the_budget_is_the_number_of_tiles_that_fall_due(seed):
    """Densities that a tiling realises exactly: it comes back, and sum(θ_s θ_t) = batch * s² means that on average a
    batch of tiles falls due per cycle, each at its own rate."""
    config = TsarConfig(batch_size=32)
    g = torch.Generator().manual_seed(seed)
    tiling = build(10.0 ** (3 * torch.rand(256, generator=g, dtype=torch.float64)).repeat_interleave(64), config)
    owner = tile_of_element(tiling, 7)
    rate = 0.05 + torch.rand(tiling.tile_count, generator=g, dtype=torch.float64)
    for _ in range(50):
        rate = (rate * config.batch_size / rate.sum()).clamp(max=1.0)
    spatial, temporal = (config.samples * 4.0 ** tiling.level.double() / 16384)[owner], rate[owner]
    assert float((spatial * temporal).sum()) == pytest.approx(config.budget)
    again = build(spatial, config)
    assert torch.equal(again.level, tiling.level) and torch.equal(again.index, tiling.index)
    due = tile_integral(prefix_sum(spatial * temporal), tiling.level, tiling.index, 7) / config.samples
    assert torch.allclose(due, rate) and float(due.sum()) == pytest.approx(config.batch_size)
    counts, history = torch.zeros(tiling.tile_count, dtype=torch.float64), initial_history(config)
    for _ in range(400):
        selected, history = select(tiling, temporal, history, config)
        counts[selected] += 1
    assert float((counts / 400 - rate).abs().max()) < 0.02


def test_selection_is_deterministic_and_depends_on_the_seed():
    density = torch.rand(16384, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    same = [select(uniform(4), density, initial_history(TsarConfig(seed=5)), TsarConfig())[0] for _ in range(2)]
    assert torch.equal(*same)
    assert not torch.equal(initial_history(TsarConfig(seed=5)), initial_history(TsarConfig(seed=6)))


def test_history_survives_retiling():
    config = TsarConfig(batch_size=64)
    density = torch.full((16384,), 0.25, dtype=torch.float64)
    _, history = select(uniform(4), density, torch.zeros(16384, dtype=torch.float64), config)
    selected, _ = select(uniform(5), density, history, config)
    # The first 64 coarse tiles were just rendered: their children are the least overdue.
    assert int(selected.min()) >= 64 * 4


def test_positions_are_exact_grid_centres_in_morton_order():
    position = sample_positions(torch.tensor([7, 2]), torch.tensor([16383, 0]), 16)
    scaled = position.to(torch.float64) * 65536
    assert torch.equal(scaled, scaled.round()) and position.max() < 1.0
    assert position[1, 0].tolist() == [1 / 128, 1 / 128]
    cell = int(interleave(torch.tensor(3), torch.tensor(2)))
    assert position[1, cell].tolist() == [3.5 / 64, 2.5 / 64]


def test_a_batch_is_all_at_one_time():
    tiling = uniform(3)
    batch = make_batch(tiling, torch.tensor([1, 5]), 1.25, 9, TsarConfig())
    assert batch.position.shape == (2, 256, 2) and bool((batch.times == 1.25).all()) and batch.cycle == 9
