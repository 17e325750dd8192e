"""Knobs, the cases of their settings, the search, and the tables of what was measured."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.comparison.front import Front, read_front
from analysis.metrics.front import on_front
from analysis.storage.files import write_json
from analysis.study.cases import SCALES, Case
from analysis.trade.knobs import KNOBS, KnobSetting, Where, alone, case_of, chosen_knobs, said, setting_of, turned
from analysis.trade.options import TradeOptions
from analysis.trade.runs import Point, places, points_of, runs
from analysis.trade.search import search, searched
from analysis.trade.shown import shown_tables
from analysis.trade.store import front_file
from analysis.trade.tables import RunResult, knees, knob_table, point_table, relative, sentences
from tsar.config import ConfigError, TsarConfig
from tsar.filtering.options import DEFAULT, FilterOptions

OPTIONS = TradeOptions(inputs=("chase", "planescene"), repetitions=2)
HERE = Where("chase", "", 3, 0.25)


def base(scale: str) -> Case:
    return Case("chase", "tsar", SCALES[scale].config(7, TsarConfig()), SCALES[scale], ledger="work")


@pytest.mark.parametrize("scale", SCALES)
def test_every_value_of_every_knob_changes_its_case_and_nothing_else(scale: str) -> None:
    refused = set()
    for knob in KNOBS.values():
        standing = case_of(KnobSetting(knob.policy), HERE, SCALES[scale], base(scale))
        for value, setting in alone(knob):
            try:
                case = case_of(setting, HERE, SCALES[scale], base(scale))
            except ConfigError:
                refused.add((knob.name, value))
                continue
            assert (case == standing) == (value == knob.default), (knob.name, value)
            assert case.tsar.seed == 3 and case.phase == 0.25 and case.display_px == 512 // SCALES[scale].divisor
            changed = {f.name for f in dataclasses.fields(case) if getattr(case, f.name) != getattr(standing, f.name)}
            own = (
                {"parts"} if knob.part else {"tracing"} if knob.tracing else {"policy"} if not knob.field else {"tsar"}
            )
            own = {"tsar"} if knob.name == "resolution" else own
            assert changed <= own | ({"samples_per_s"} if knob.name in ("batch", "framelet") else set())
    assert refused == (set() if scale == "thesis" else {("resolution", 0.25)})


def test_the_pace_is_that_of_the_machine_of_the_other_studies() -> None:
    """At row 7 a cycle of tsar takes as long as on the machine that shows 8 framed images a second."""
    from analysis.metrics.cost_model import CAPACITY_DEFAULT, parameters_of, policy_flops
    from tsar.policies.filter import Filter
    from tsar.policy import Setting as OfAPolicy

    config = TsarConfig()
    price = Filter(OfAPolicy(config)).price
    cycle_s = float(policy_flops(parameters_of(config, 4.0), price)) / CAPACITY_DEFAULT
    case = case_of(turned(), HERE, SCALES["thesis"], base("thesis"))
    assert case.samples_per_s is not None and price.samples / case.samples_per_s == pytest.approx(cycle_s, rel=0.01)


def test_all_options_of_the_policy_but_for_one_bound_are_knobs() -> None:
    parts = {knob.part for knob in KNOBS.values() if knob.part}
    assert {one.name for one in dataclasses.fields(FilterOptions)} - parts == {"life_min_s"}
    assert all(knob.default == getattr(DEFAULT, knob.part) for knob in KNOBS.values() if knob.part)


def test_settings_are_named_by_what_differs() -> None:
    assert setting_of("tsar", {"batch": 128, "jitter": True}) == KnobSetting() and KnobSetting().words == "tsar"
    assert turned(jitter=False, batch=16, share_max=1 / 64).words == "tsar, batch 16, share-max 1/64, jitter off"
    assert said(1 / 3) == "0.333333" and said(0.05) == "0.05" and said("sum") == "sum"
    with pytest.raises(ConfigError, match="knobs: expected none twice"):
        chosen_knobs(["batch", "batch"])


def test_the_default_is_measured_at_every_place() -> None:
    assert [(one.input, one.seed, one.phase) for one in places(OPTIONS)] == [
        ("chase", 0, 0.0), ("planescene", 0, 0.0), ("chase", 1, 0.5), ("planescene", 1, 0.0),
    ]  # fmt: skip
    assert KnobSetting() in [point.setting for point in points_of(chosen_knobs(["tiles"]))]
    found, dropped = runs(OPTIONS, points_of(chosen_knobs(["resolution"])))
    assert len(found) == 4 * 2 and list(dropped) == ["tsar, resolution 0.25"]


def test_a_short_run_is_scored_whole() -> None:
    """The default span of JOD is no longer than the run."""
    short = dataclasses.replace(OPTIONS, seconds=0.1)
    found, _ = runs(short, points_of(chosen_knobs(["batch"])))
    assert {one.case.jod_span_s for one in found} == {(0.0, 0.1)}
    with pytest.raises(ConfigError, match="jod_s: expected between"):
        dataclasses.replace(OPTIONS, jod_s=3.0)


def test_a_search_nears_the_front_and_is_the_same_again() -> None:
    """Cost and error by a simple function of two knobs: the batch costs, and jitter is free."""
    knobs = searched(chosen_knobs(["batch", "jitter", "depth", "policy", "structure", "tiles"]))
    assert [knob.name for knob in knobs] == ["batch", "jitter", "depth"]
    asked = list[list[Point]]()

    def measure(points: Any) -> list[tuple[float, float] | None]:
        asked.append(list(points))
        found = []
        for point in points:
            values = dict(point.setting.changes)
            batch = float(values.get("batch", 128))
            found.append(
                None if values.get("depth") == 1 else (batch, (1.0 if values.get("jitter", True) else 9.0) / batch)
            )
        return found

    tried = search(knobs, 30, 6, 5, measure)
    assert tried[0].setting == KnobSetting() and [point.value for point in tried] == list(range(30))
    assert [len(one) for one in asked] == [6] * 5
    jittered = ["jitter" not in dict(point.setting.changes) for point in tried]
    assert sum(jittered[15:]) > 10
    assert search(knobs, 30, 6, 5, measure) == tried and search(knobs, 30, 6, 6, measure) != tried


def results(seed: int = 0) -> list[RunResult]:
    """Runs of a simple law: the error falls with cost, and every input has its own level."""
    drawn = np.random.default_rng(seed)
    found = []
    points = [*points_of(chosen_knobs(["batch", "smoothing"])), Point("search", 1, turned(batch=64, jitter=False))]
    for run in runs(OPTIONS, points)[0]:
        values = dict(run.point.setting.changes)
        batch = float(values.get("batch", 128))
        level = {"chase": 1.0, "planescene": 100.0}[run.where.input] * np.exp(drawn.normal(0.0, 0.01))
        worse = (4.0 if values.get("smoothing") is False else 1.0) * (0.4 if values.get("jitter") is False else 1.0)
        mse = 1e-4 * level * worse / batch
        flops = dict.fromkeys(("thesis", "printed", "summed", "work"), 1e6 * (batch + 16.0))
        spent = {"flops": flops, "latency_s": 0.005, "counters": {"primary_rays": 10.0 * batch, "shadow_rays": 1.0}}
        machine = {"cycles_s": 0.01 * batch, "run_memory_bytes": 4096}
        summary = {"spent": spent, "machine": machine, "jod": 7.0 - worse, "key": run.case.name}
        times = pd.DataFrame({"mse": [mse, mse], "flip": [0.1, np.nan], "ssim": [0.9, np.nan]})
        found.append(RunResult(run, summary, times))
    return found


def test_tables_say_what_a_knob_costs_and_does() -> None:
    points = point_table(results(), "work")
    assert len(points) == 4 * (6 + 2 + 1) and points["on_front"].dtype == bool
    for _, own in points.groupby(["input", "seed"]):
        assert (on_front(own["cost_flops"].to_numpy(), own["mse"].to_numpy()) == own["on_front"]).all()
    knobs = knob_table(points, 50).set_index(["knob", "value"])
    assert knobs.loc[("batch", "128"), "mse"] == 1.0 and knobs.loc[("smoothing", "off"), "mse"] == pytest.approx(
        4.0, rel=0.05
    )
    assert (
        knobs.loc[("batch", "512"), "cost_flops"] == pytest.approx(528 / 144)
        and knobs.loc[("smoothing", "off"), "jod"] == -3.0
    )
    assert ((knobs["mse_low"] <= knobs["mse"]) & (knobs["mse"] <= knobs["mse_high"])).all()
    told = sentences(knobs.reset_index())
    assert (
        told["smoothing"].startswith("Relative to the default (on), off has 1.00 times the FLOPs and ")
        and told["batch"].count(" has ") == 2
    )

    found = relative(points, 50)
    assert found.bands is not None and found.settings[0] == "tsar"
    front = found.front.set_index("setting")
    assert front.loc["tsar", "error"] == 1.0 and not front.loc["tsar, smoothing off", "on_front"]
    assert front.loc["tsar, batch 64, jitter off", "on_front"] and front["knee"].sum() == 1
    assert set(knees(points)["input"]) == {"chase", "planescene"}
    shown = shown_tables({"front": found.front, "knobs": knobs.reset_index(), "knees": knees(points)})
    assert len(shown) == 4 and all("nan" not in cell for table in shown for row in table.rows for cell in row)


def test_nothing_measured_gives_empty_tables() -> None:
    points = point_table([], "work")
    assert relative(points, 10).settings == [] and knob_table(points, 10).empty and knees(points).empty
    assert shown_tables({"front": pd.DataFrame(), "knobs": pd.DataFrame(), "knees": pd.DataFrame()}) == []
    assert front_file(points, OPTIONS) is None


def test_the_front_is_stored_for_each_pixel_and_second(tmp_path: Any) -> None:
    points = point_table(results(), "work")
    points["input"] = points["input"].replace("planescene", "/scenes/cornell-box/scene.pbrt")
    stored = front_file(points, OPTIONS)
    assert stored is not None and stored["made"]["inputs"] == ["chase", "cornell-box/scene.pbrt"]
    write_json(tmp_path / "front.json", stored)
    front = read_front(tmp_path / "front.json")
    assert [place.batch for place in front.places] == [16, 32, 64, 256, 512]
    middle = front.places[2]
    assert middle.parts == (("jitter", False),) and middle.words == "batch 64, jitter 0"
    assert middle.flops["work"] == pytest.approx(80e6 / 128**2 / 2.0) and middle.wall_s == pytest.approx(
        0.64 / 128**2 / 2.0
    )
    assert front.preset("balanced") == front.knee
    for path, text in (("none.json", None), ("bad.json", "{}"), ("odd.json", '{"made": {}, "places": [{"batch": 1}]}')):
        if text is not None:
            (tmp_path / path).write_text(text)
        with pytest.raises(ValueError, match="expected a front of trade.py"):
            read_front(tmp_path / path)


def test_a_default_as_good_as_the_knee_is_stored_in_its_place() -> None:
    """A point near the default that beats it by 2 % is the knee; what is stored is the default."""
    points = point_table(results(), "work")
    steep = {"tsar, batch 16": 1e-3, "tsar, batch 32": 8e-4, "tsar, batch 64": 6e-4, "tsar": 1.02e-5}
    points["mse"] = points["setting"].map(lambda name: steep.get(name, 9.9e-6))
    at = points["setting"] == "tsar, batch 64, jitter off"
    points.loc[at, ["mse", "cost_flops"]] = 1e-5, 0.98 * 144e6
    front = relative(points, 10).front.set_index("setting")
    assert front.loc["tsar, batch 64, jitter off", "knee"]
    stored = front_file(points, OPTIONS)
    assert stored is not None
    middle = [place for place in stored["places"] if place["knee"]]
    assert [(place["batch"], place["parts"], place["cost"]) for place in middle] == [(128, {}, 1.0)]
    costs, errors = ([place[name] for place in stored["places"]] for name in ("cost", "error"))
    assert costs == sorted(costs) and errors == sorted(errors, reverse=True) and len(costs) >= 4


@given(st.floats(1e3, 1e10), st.floats(1e-9, 1.0))
def test_budgets_buy_the_most_accurate_and_targets_the_cheapest(flops: float, mse: float) -> None:
    front = some_front()
    bought = front.within_flops(flops, "work")
    affordable = [place for place in front.places if place.flops["work"] <= flops]
    assert bought == (min(affordable, key=lambda one: one.mse) if affordable else front.places[0])
    good = [place for place in front.places if place.mse <= mse]
    assert front.at_error(mse) == (min(good, key=lambda one: one.cost) if good else front.places[-1])
    assert front.preset("draft") == front.places[0] and front.preset("accurate") == front.places[-1]


def some_front() -> Front:
    from analysis.comparison.front import FrontPoint

    places = [
        FrontPoint(16 * 2**k, (), {"work": 1e6 * 2.0**k}, 1e-6 * 2**k, 0.1 / 2**k, 0.125 * 2.0**k, 8.0 / 2**k, k == 3)
        for k in range(6)
    ]
    return Front(tuple(places), {})
