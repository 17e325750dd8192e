"""Broken invariants are found, from records as they arrive and from a file alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.storage.invariants import InvariantCheck, covers_once
from tests.analysis.builders import ELEMENTS, LIMITS, SPATIAL, TEMPORAL, good_record, random_tiling, tiling
from tests.analysis.storage.test_records import write
from tests.oracles.steps import check_invariants
from tsar.morton import deinterleave
from tsar.types import Errors, StepRecord

COUNTED = ("densities_out_of_bounds", "tiling_not_a_cover", "batch_not_full", "nonfinite")


def checked(path: Path, records: Iterable[StepRecord], rows_per_group: int = 32) -> dict[str, Any]:
    """What is found in the file; the records as they come must tell the same."""
    check = InvariantCheck(LIMITS)

    def passing() -> Iterator[StepRecord]:
        for record in records:
            check.add(record)
            yield record

    found = check_invariants(write(path, passing(), rows_per_group))
    assert check.result() == found
    return found


def field(value: float, element: int = 5, elsewhere: float = 1.0) -> torch.Tensor:
    """One element that differs."""
    values = torch.full((ELEMENTS,), elsewhere, dtype=torch.float64)
    values[element] = value
    return values


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.integers(1, 40))
def test_a_good_run_passes(tmp_path_factory: pytest.TempPathFactory, seed: int, count: int) -> None:
    path = tmp_path_factory.mktemp("run") / "steps.parquet"
    found = checked(path, (good_record(seed + i) for i in range(count)), 7)
    assert found["ok"] is True and found["cycles"] == count and not any(found[name] for name in COUNTED)
    assert found["conservation_residual"] < 1e-6


FOUR = [(1, 0), (1, 1), (1, 2), (1, 3)]
ZERO = torch.zeros(ELEMENTS)
BROKEN = {
    "spatial density too great": (dict(spatial=field(SPATIAL[1] * 1.001)), "densities_out_of_bounds"),
    "spatial density too small": (dict(spatial=field(SPATIAL[0] * 0.999)), "densities_out_of_bounds"),
    "temporal density too great": (dict(temporal=field(TEMPORAL[1] * 1.001)), "densities_out_of_bounds"),
    "temporal density too small": (dict(temporal=field(TEMPORAL[0] * 0.999)), "densities_out_of_bounds"),
    "tile and its child": (dict(tiling=tiling(*FOUR, (2, 5))), "tiling_not_a_cover"),
    "a tile twice": (dict(tiling=tiling(*FOUR, (1, 3))), "tiling_not_a_cover"),
    "hole at the start": (dict(tiling=tiling((1, 1), (1, 2), *((2, i) for i in range(12, 16)))), "tiling_not_a_cover"),
    "hole in the middle": (dict(tiling=tiling((1, 0), (2, 4), (2, 5), (2, 7), (1, 2), (1, 3))), "tiling_not_a_cover"),
    "hole at the end": (dict(tiling=tiling((1, 0), (1, 1), (1, 2), (2, 12))), "tiling_not_a_cover"),
    "hole and overlap of one size": (dict(tiling=tiling((1, 0), (1, 1), (1, 1), (1, 3))), "tiling_not_a_cover"),
    "tile outside the image": (dict(tiling=tiling(*FOUR, (1, 4))), "tiling_not_a_cover"),
    "a tile selected twice": (dict(selected=torch.tensor([0, 1, 2, 1])), "batch_not_full"),
    "a batch one short": (dict(selected=torch.tensor([0, 1, 2])), "batch_not_full"),
    "a batch one over": (dict(tiling=random_tiling(3), selected=torch.arange(5)), "batch_not_full"),
    "a tile that is not there": (dict(tiling=tiling(*FOUR), selected=torch.tensor([0, 1, 2, 4])), "batch_not_full"),
    "a NaN error": (dict(errors=Errors(torch.full((ELEMENTS,), math.nan), ZERO)), "nonfinite"),
    "an infinite error": (dict(errors=Errors(ZERO, torch.full((ELEMENTS,), -math.inf))), "nonfinite"),
    "a negative tile": (dict(selected=torch.tensor([-1, 1, 2, 3])), "batch_not_full"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_each_broken_invariant_is_counted_once_and_alone(tmp_path: Path, case: str) -> None:
    changes, name = BROKEN[case]
    found = checked(tmp_path / "a.parquet", (good_record(i, **(changes if i == 20 else {})) for i in range(24)), 9)
    assert {key: found[key] for key in COUNTED} == {key: int(key == name) for key in COUNTED}
    assert found["ok"] is False and found["cycles"] == 24 and found["conservation_residual"] < 1e-6


@pytest.mark.parametrize("off", [1.0, -1.0])
def test_lost_and_gained_density_is_found_from_the_stored_fields(tmp_path: Path, off: float) -> None:
    """The record claims that all is well."""
    broken = replace(good_record(1), surplus=good_record(1).surplus + off)
    found = checked(tmp_path / "a.parquet", [good_record(0), broken, good_record(2)])
    assert found["ok"] is False and found["conservation_residual"] == pytest.approx(1e-3, rel=0.01)
    assert not any(found[name] for name in COUNTED)


@pytest.mark.parametrize("residual", [1e-3, math.nan, math.inf])
def test_a_residual_on_record_is_believed(tmp_path: Path, residual: float) -> None:
    records = [good_record(0), good_record(1, conservation_residual=residual), good_record(2)]
    found = checked(tmp_path / "a.parquet", records)
    assert found["ok"] is False and found["conservation_residual"] >= 1e-3


@pytest.mark.parametrize("name", ["spatial", "temporal"])
def test_nan_densities_are_found(tmp_path: Path, name: str) -> None:
    broken = good_record(1, **{name: field(math.nan)})
    found = checked(tmp_path / "a.parquet", [good_record(0), broken, good_record(2)])
    assert found["ok"] is False and found["densities_out_of_bounds"] == 1
    assert found["conservation_residual"] == math.inf


def test_a_check_tells_at_any_time_what_it_has_seen() -> None:
    check = InvariantCheck(LIMITS)
    assert check.result() == {"cycles": 0, "conservation_residual": 0.0, **dict.fromkeys(COUNTED, 0), "ok": False}
    check.add(good_record(0))
    first = check.result()
    assert first["ok"] is True and first["cycles"] == 1
    for number in (1, 2):
        check.add(good_record(number, selected=torch.tensor([0, 1, 2, 1])))
        found = check.result()
        assert found["ok"] is False and (found["cycles"], found["batch_not_full"]) == (number + 1, number)
    check.add(good_record(3))
    assert check.result()["ok"] is False, "once broken, broken"
    assert first["cycles"] == 1 and first["batch_not_full"] == 0, "earlier results stay as they were"


def test_densities_are_rounded_as_in_a_file(tmp_path: Path) -> None:
    """A density beyond its bound by less than a float32 step passes both ways, one beyond by more fails both ways."""
    for excess, broken in ((1e-9, 0), (3e-6, 1)):
        record = good_record(1, spatial=field(SPATIAL[1] * (1 + excess)))
        assert checked(tmp_path / f"{broken}.parquet", [record])["densities_out_of_bounds"] == broken


def painted_once(level: list[int], index: list[int]) -> bool:
    """Slow: every cell of the finest grid is painted by exactly one tile."""
    finest = max(level)
    count = np.zeros((2**finest, 2**finest), int)
    for lev, i in zip(level, index, strict=True):
        x, y = (int(v) << (finest - lev) for v in deinterleave(torch.tensor(i)))
        size = 1 << (finest - lev)
        count[y : y + size, x : x + size] += 1
    return bool((count == 1).all())


@given(st.integers(0, 10_000), st.lists(st.tuples(st.integers(0, 60), st.integers(0, 3), st.integers(0, 63))))
def test_covers_once_agrees_with_painting(seed: int, changes: list[tuple[int, int, int]]) -> None:
    tiles = random_tiling(seed, 3)
    level, index = tiles.level.tolist(), tiles.index.tolist()
    assert covers_once(np.array(level), np.array(index))
    for place, new_level, new_index in changes[:2]:
        level[place % len(level)], index[place % len(level)] = new_level, new_index % 4**new_level
    assert covers_once(np.array(level), np.array(index)) == painted_once(level, index)
    assert not covers_once(np.array([], int), np.array([], int))
