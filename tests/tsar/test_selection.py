import torch

from tsar.config import TsarConfig
from tsar.morton import interleave
from tsar.selection import initial_history, make_batch, sample_positions, select
from tsar.tiling import uniform


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
    assert batch.position.shape == (2, 256, 2) and bool((batch.time_s == 1.25).all()) and batch.cycle == 9
