"""Options, rows and turns of the benchmark."""

from pathlib import Path

import pytest

from analysis.bench.options import GROUPS, BenchOptions
from analysis.bench.rows import Row, limit_row, limited_row, rate_row
from analysis.command.progress import Task
from analysis.command.timing import take_turns

ROW = Row("coherent", "camera rays", "M rays/s", 0.0, "Embree", note="kept")


def test_cases_take_turns_both_ways() -> None:
    order, rounds = [], []
    seconds = take_turns({name: lambda name=name: order.append(name) for name in "abc"}, 3, Task(show=rounds.append))
    assert "".join(order) == "abc" + "abccbaabc"
    assert rounds == [1, 2, 3] and all(len(values) == 3 for values in seconds.values())


def test_turns_are_timed_by_the_clock_that_is_given() -> None:
    now = [0.0]

    def work(seconds: float) -> None:
        now[0] += seconds

    seconds = take_turns({"a": lambda: work(1.0), "b": lambda: work(3.0)}, 2, clock=lambda: now[0])
    assert seconds == {"a": [1.0, 1.0], "b": [3.0, 3.0]}


def test_rates_and_the_median_of_the_ratios_of_the_rounds() -> None:
    row = rate_row(ROW, 12.0, [1.0, 2.0, 4.0], [2.0, 2.0, 40.0], target=2.0)
    assert (row.ours, row.peer, row.repetitions, row.note) == (6.0, 6.0, 3, "kept")
    # of the rounds 2, 1 and 10; the ratio of the medians would be 1
    assert row.ratio == 2.0 and row.met is True
    assert row.spread == (1.0, 10.0)


def test_a_target_is_missed_just_below_it() -> None:
    seconds = [1.0] * 7
    assert rate_row(ROW, 1.0, seconds, [1.999] * 7, target=2.0).met is False
    assert rate_row(ROW, 1.0, seconds, [2.0] * 7, target=2.0).met is True
    assert rate_row(ROW, 1.0, seconds, [2.0] * 7).met is None


def test_without_a_peer_only_our_rate_is_known() -> None:
    row = rate_row(ROW, 10.0, [2.0, 2.0, 2.0], None, target=3.0)
    assert (row.ours, row.peer, row.ratio, row.spread, row.met) == (5.0, None, None, None, None)
    assert row.target == 3.0


def test_a_limit_is_kept_up_to_itself() -> None:
    row = limit_row(ROW, [0.10, 0.15, 0.60], 0.15)
    assert (row.ours, row.peer, row.target, row.met) == (0.15, 0.15, 1.0, True)
    assert row.ratio == 1.0 and row.spread == pytest.approx((0.25, 1.5)) and row.less_is_better
    assert limit_row(ROW, [0.16] * 3, 0.15).met is False


def test_one_value_has_no_spread() -> None:
    row = limited_row(ROW, [3.0], 2.0, [0.5])
    assert row.spread is None and row.repetitions == 1 and row.met is False


def test_a_stored_row_says_whether_it_met_its_target() -> None:
    stored = limit_row(ROW, [1.0, 1.0], 2.0).record()
    wanted = {"group", "name", "unit", "ours", "peer_name", "peer", "ratio", "spread", "target", "met", "repetitions"}
    assert wanted <= set(stored) and stored["met"] is True


@pytest.mark.parametrize(
    ("only", "groups"),
    [
        ((), GROUPS),
        (("start,coherent",), ("coherent", "start")),
        (("order", "cores , order"), ("cores", "order")),
    ],
)
def test_groups_are_asked_for_once_or_with_commas(only: tuple[str, ...], groups: tuple[str, ...]) -> None:
    assert BenchOptions(only=only).groups == groups


def test_figures_of_a_gpu_go_into_files_of_their_own() -> None:
    assert BenchOptions().file_ending == "" and BenchOptions(device="cuda:0").file_ending == "-cuda"


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"only": ("coherent,nonsense",)}, "nonsense"),
        ({"repetitions": 6}, "repetitions"),
        ({"resolution_px": 500}, "resolution_px"),
        ({"resolution_px": 32}, "resolution_px"),
        ({"batch_size": 1025}, "batch_size"),
        ({"batch_size": 0}, "batch_size"),
        ({"subdivisions": (4, 10)}, "subdivisions"),
        ({"cycles": 99}, "cycles"),
    ],
)
def test_bad_options_are_named(change: dict, name: str) -> None:
    with pytest.raises(ValueError, match=name):
        BenchOptions(Path("unused"), **change)
