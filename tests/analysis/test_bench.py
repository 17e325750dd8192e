"""Measuring samples per second: what is asked of the renderer, and how turns are taken."""

from pathlib import Path

import pytest
import torch

from analysis.bench import BenchOptions, in_rows, measure, morton_batches, take_turns
from tsar.selection import sample_positions
from tsar.types import FrameletBatch, SampleBatch

SMALL = BenchOptions(Path("unused"), level=2, batch_size=6, framelet_side=4, repetitions=7)


def test_batches_cover_the_picture_once_in_morton_order() -> None:
    batches = morton_batches(SMALL, 3.0)
    assert [batch.level.shape[0] for batch in batches] == [6, 5, 5]
    for batch in batches:
        assert torch.equal(batch.position, sample_positions(batch.level, batch.index, 4))
        assert batch.time_s.unique().numel() == 1
    assert [batch.time_s[0, 0].item() for batch in batches] == [0.5, 1.5, 2.5]
    everything = torch.cat([batch.position.reshape(-1, 2) for batch in batches])
    assert everything.unique(dim=0).shape[0] == everything.shape[0] == 16 * 16


def test_rows_hold_the_same_samples_from_top_to_bottom() -> None:
    batch = morton_batches(SMALL, 3.0)[1]
    rows = in_rows(batch)
    x, y = rows.position.reshape(-1, 2).T
    key = y * 1000 + x
    assert (key.diff() > 0).all()
    assert torch.equal(
        key.sort().values, (batch.position[..., 1] * 1000 + batch.position[..., 0]).flatten().sort().values
    )
    assert rows.time_s.shape == batch.time_s.shape


def test_cases_take_turns_both_ways() -> None:
    order, rounds = [], []
    seconds = take_turns({name: lambda name=name: order.append(name) for name in "abc"}, 3, rounds.append)
    assert "".join(order) == "abc" + "abccbaabc"
    assert rounds == [1, 2, 3] and all(len(values) == 3 for values in seconds.values())


def test_measurement_counts_samples_and_rays() -> None:
    asked = []

    def trace(batch: FrameletBatch) -> SampleBatch:
        asked.append(batch)
        count = batch.time_s.numel()
        return SampleBatch(torch.zeros(*batch.time_s.shape, 3), {"primary_rays": count, "shadow_rays": 2 * count})

    summary = measure(SMALL, {1: trace, 2: trace}, 3.0)
    assert summary["samples"] == 256
    assert summary["counters"] == {"primary_rays": 256, "shadow_rays": 512}
    assert {(case["threads"], case["order"]) for case in summary["cases"]} == {
        (threads, order) for threads in (1, 2) for order in ("Morton", "rows")
    }
    assert all(len(case["all"]) == 7 and case["samples_per_s"] > 0 for case in summary["cases"])
    assert set(summary["speed_up_of_threads"]) == {"Morton", "rows"}
    assert set(summary["speed_up_of_morton_order"]) == {"1", "2"}
    assert len(asked) == 3 * (4 * 8 + 1)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"threads": 1}, "threads"),
        ({"repetitions": 6}, "repetitions"),
        ({"level": 9}, "level"),
        ({"batch_size": 2000}, "batch_size"),
        ({"framelet_side": 12}, "framelet_side"),
    ],
)
def test_bad_options_are_named(change: dict, name: str) -> None:
    with pytest.raises(ValueError, match=name):
        BenchOptions(Path("unused"), **change)
