"""Simulated observers answer by their rule, independently of each other."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from analysis.perception.analysis import comparisons, fits, power, strongest
from analysis.perception.nulls import described, false_positives
from analysis.perception.observers import (
    COLUMNS,
    JOD_SIGMA,
    Observer,
    correct_probability,
    drawn_observers,
    dual_pair_share,
    simulated_trials,
)
from analysis.perception.options import RecoverOptions


def stimuli(scale: tuple[float, float] = (1.0, 2.0)) -> pd.DataFrame:
    """Differences that fall with samples, in two scenes and two sets."""
    rows = [
        {"scene": scene, "point_set": name, "time_filter": "box", "samples": level, "jod": factor * 8.0 / level**0.5}
        for scene, factor in zip(("planescene", "spheresscene"), scale, strict=True)
        for name in ("hammersley", "stratified")
        for level in (1, 8, 27, 64, 125, 216, 343, 512)
    ]
    return pd.DataFrame(rows)


def test_the_differencing_rule() -> None:
    """Chance at no difference; 0.75 at d' = 2.10, so 2.21 JOD; and by brute force."""
    assert dual_pair_share(np.array(0.0)) == 0.5
    assert dual_pair_share(np.array(2.10)) == pytest.approx(0.75, abs=1e-3)
    perfect = Observer("x", 1.0, 0.0)
    assert correct_probability(np.array(2.21), perfect) == pytest.approx(0.75, abs=2e-3)
    assert pytest.approx(1.0 / (np.sqrt(2.0) * 0.67449), abs=1e-3) == JOD_SIGMA
    rng = np.random.default_rng(0)
    a, b, c, d = rng.standard_normal((4, 400_000))
    right = np.abs(a + 1.5 - b) > np.abs(c - d)
    assert right.mean() == pytest.approx(float(dual_pair_share(np.array(1.5))), abs=3e-3)


def test_lapses_and_sensitivity() -> None:
    jod = np.array([0.0, 1.0, 50.0, -3.0])
    lapsing = correct_probability(jod, Observer("x", 1.0, 0.1))
    assert lapsing[[0, 3]] == pytest.approx(0.5) and lapsing[2] == pytest.approx(0.95)
    keen = correct_probability(jod, Observer("y", 3.0, 0.0))
    assert keen[1] == pytest.approx(float(correct_probability(np.array(3.0), Observer("z", 1.0, 0.0))))


def test_trials_of_an_observer_do_not_depend_on_others() -> None:
    people = drawn_observers(3, 5, 0.3, 0.02)
    assert people == drawn_observers(3, 5, 0.3, 0.02) and len({one.sensitivity for one in people}) == 3
    alone, together = simulated_trials(stimuli(), people[:1], 4, 7), simulated_trials(stimuli(), people, 4, 7)
    pd.testing.assert_frame_equal(alone, together[together["observer"] == "s00"].reset_index(drop=True))
    assert tuple(together.columns) == COLUMNS and len(together) == 3 * 32 * 4
    asked = together.groupby(["observer", "scene", "point_set", "samples"]).size()
    assert (asked == 4).all() and set(together["observer_kind"]) == {"simulated"}
    assert ((together["answer"] == together["differing_side"]) == together["correct"]).all()
    assert 0.4 < (together["differing_side"] == "left").mean() < 0.6


def test_the_harder_scene_has_the_higher_threshold_and_the_tests_see_it() -> None:
    trials = simulated_trials(stimuli(), drawn_observers(12, 1, 0.1, 0.01), 4, 1)
    fitted = fits(trials, 100, 0)
    scenes = fitted[fitted["point_set"].isna() & fitted["time_filter"].isna()].set_index("scene")
    assert scenes.loc["planescene", "high"] < scenes.loc["spheresscene", "low"]
    assert len(fitted) == 2 + 2 + 2 + 4
    tested = comparisons(trials)
    of_scenes = tested[(tested["of"] == "scene") & (tested["samples"] == 27)].iloc[0]
    assert of_scenes["degrees"] == 11 and of_scenes["t"] < 0.0 and of_scenes["p"] < 0.01
    assert of_scenes["thesis_p"] == 0.0027
    of_sets = tested[(tested["of"] == "point_set")]
    assert (of_sets["p"].dropna() > 0.001).all()  # the sets do not differ here


def test_filters_and_shifts_are_compared_as_scenes_are() -> None:
    """One filter needs more samples: the tests of every level find that over observers, and state their number."""
    box = stimuli()
    both = pd.concat([box, box.assign(time_filter="triangle", jod=4.0 * box["jod"])], ignore_index=True)
    trials = simulated_trials(both, drawn_observers(12, 1, 0.2, 0.01), 4, 3, 0.5)
    tested = comparisons(trials)
    filters = tested[tested["of"] == "time_filter"].set_index("samples")
    assert filters.loc[27, "degrees"] == 11
    assert filters.loc[64, "t"] < -4.0 and filters.loc[64, "p"] < 1e-3
    best = strongest(tested).set_index(["first", "second"])
    assert best.loc[("box", "triangle"), "p"] == filters["p"].min()
    assert best.loc[("box", "triangle"), "corrected_p"] == pytest.approx(
        filters["p"].min() * filters["p"].notna().sum()
    )
    assert best.loc[("hammersley", "stratified"), "corrected_p"] > 0.02


def test_false_positives_are_counted_over_observers_and_over_cells() -> None:
    """Where observers differ much, entries of one observer are alike, and tests that count them find too much."""
    options = RecoverOptions(experiments=16, answers=36)
    counted = []
    row = false_positives(options, 2.0, lambda: counted.append(1))
    assert len(counted) == 16 and 100 < row["tests"] <= 16 * 8
    assert 0.01 < row["by_observer"] < 0.08 and row["by_cell"] > 2.0 * row["by_observer"]
    assert "2 octaves apart" in described(row)


def test_one_observer_makes_no_tests() -> None:
    row = false_positives(RecoverOptions(experiments=1, observers=1), 0.5)
    assert row["tests"] == 0 and described(row).endswith("no test, which needs two observers whose answers differ")


def test_power_is_less_where_observers_differ() -> None:
    levels = (1, 8, 27, 64, 125, 216, 343, 512)
    alike, apart = (power(levels, (40.0, 100.0), 1.5, (12,), (4,), 4, 0, spread) for spread in (0.0, 2.0))
    assert apart["interval_ratio_median"][0] > 1.3 * alike["interval_ratio_median"][0]


def test_more_answers_tell_more_apart() -> None:
    found = power((1, 8, 27, 64, 125, 216, 343, 512), (40.0, 100.0), 1.5, (2, 24), (4,), 12, 0)
    few, many = found["told_apart"]
    assert few < many and many > 0.5
    assert found["interval_ratio_median"].iloc[0] > found["interval_ratio_median"].iloc[1] > 1.0
