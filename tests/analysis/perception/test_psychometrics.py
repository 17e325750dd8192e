"""Fits recover the functions that answers were drawn from, and say so if they cannot."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from analysis.command.cli import InputError
from analysis.perception.analysis import recovery
from analysis.perception.peer import peer_fit
from analysis.perception.psychometrics import FitError, Rule, correct_share, fit, paired, tail_share, threshold_samples
from tsar.checks import ConfigError

LEVELS = (1, 8, 27, 64, 125, 216, 343, 512)


def drawn(jnd: float, sigma: float, trials: int, seed: int, lapse: float = 0.0) -> list[int]:
    """Right answers of an observer whose threshold is known."""
    share = correct_share(np.array(LEVELS, np.float64), _mu(jnd, sigma, lapse), sigma, lapse)
    return np.random.default_rng(seed).binomial(trials, share).tolist()


def _mu(jnd: float, sigma: float, lapse: float) -> float:
    return math.log2(jnd) - math.log2(threshold_samples(0.0, sigma, lapse))


def test_the_threshold_is_where_three_quarters_are_right() -> None:
    for sigma, lapse in ((0.5, 0.0), (2.0, 0.05)):
        jnd = threshold_samples(5.0, sigma, lapse)
        assert correct_share(np.array(jnd), 5.0, sigma, lapse) == pytest.approx(0.75)
    assert threshold_samples(5.0, 1.0, 0.0) == pytest.approx(32.0)


@pytest.mark.parametrize(("jnd", "sigma", "lapse"), [(40.0, 1.0, 0.0), (100.0, 2.0, 0.03)])
def test_many_answers_give_back_the_threshold(jnd: float, sigma: float, lapse: float) -> None:
    found = fit(LEVELS, drawn(jnd, sigma, 20_000, 1, lapse), [20_000] * 8)
    assert found.jnd == pytest.approx(jnd, rel=0.03) and found.status == "within"
    assert found.sigma == pytest.approx(sigma, rel=0.1) and found.lapse == pytest.approx(lapse, abs=0.01)


def test_a_fit_is_at_least_as_likely_as_the_truth() -> None:
    correct = drawn(60.0, 1.5, 48, 5)
    found = fit(LEVELS, correct, [48] * 8)
    truth = correct_share(np.array(LEVELS, np.float64), _mu(60.0, 1.5, 0.0), 1.5, 0.0)
    k = np.array(correct)
    assert found.log_likelihood >= (k * np.log(truth) + (48 - k) * np.log1p(-truth)).sum()


def coverage(experiments: int, bootstraps: int, spread: float) -> float:
    return recovery(LEVELS, 60.0, 1.5, 0.0, spread, (12, 12), experiments, bootstraps, 0)["coverage"]


@pytest.mark.parametrize("spread", [0.0, 1.0])
def test_intervals_hold_the_threshold_about_as_often_as_they_say(spread: float) -> None:
    """Also of observers that differ. Intervals of 95 % hold fewer than 24 of 30 once in a thousand such tests."""
    assert 0.8 <= coverage(30, 100, spread) <= 1.0


def test_an_interval_holds_its_estimate() -> None:
    """Also where the likelihood is flat over many parameters: nearly a step between two levels, or few answers."""
    step = fit((1, 8, 27, 64, 125), (48, 48, 48, 24, 24), [48] * 5, 200, 3)
    assert step.interval is not None and step.interval[0] <= step.jnd <= step.interval[1]
    rng = np.random.default_rng(1)
    for number in range(30):
        chance = correct_share(np.array(LEVELS, np.float64), rng.uniform(2.0, 7.0), 1.0, 0.02)
        asked = np.full((1 + number % 4, 8), 4)
        found = fit(LEVELS, rng.binomial(asked, chance), asked, 40, number)
        assert found.interval is not None and found.interval[0] <= found.jnd <= found.interval[1]


def test_intervals_are_of_observers_not_of_answers() -> None:
    """The same number of answers says less if the observers differ; the estimate is that of all answers."""
    far = np.array([-1.5, -1.0, -0.5, 0.5, 1.0, 1.5])
    levels = np.array(LEVELS, np.float64)
    right = np.stack([np.rint(200 * correct_share(levels, 6.0 + away, 1.0, 0.0)) for away in far]).astype(np.int64)
    asked = np.full(right.shape, 200)
    by_observer = fit(LEVELS, right, asked, 200, 1)
    pooled = fit(LEVELS, right.sum(axis=0), asked.sum(axis=0), 200, 1)
    assert by_observer.jnd == pooled.jnd and by_observer.trials == pooled.trials == 8 * 1200
    widths = [math.log2(found.interval[1] / found.interval[0]) for found in (by_observer, pooled) if found.interval]
    # of six observers, 2.571 standard errors of a mean either way
    assert widths[0] == pytest.approx(2 * 2.571 * far.std(ddof=1) / math.sqrt(6), rel=0.35)
    assert widths[0] > 4.0 * widths[1]


def test_tails_are_those_of_few_observers() -> None:
    """Hesterberg 2015, sec. 4.3; for many observers the share is that of the normal distribution."""
    assert tail_share(1) == 0.025 and tail_share(10_000) == pytest.approx(0.025, abs=1e-4)
    assert tail_share(12) == pytest.approx(0.0108, abs=2e-4)
    assert 0.0 < tail_share(3) < tail_share(6) < tail_share(12)


def test_intervals_are_of_95_percent() -> None:
    """As far apart as the 2.5th and 97.5th percentiles of fits, each polished, to data drawn from the first fit."""
    asked = [16] * 8
    found = fit(LEVELS, drawn(60.0, 1.0, 16, 2), asked, 400, 7)
    assert found.interval is not None
    share = correct_share(np.array(LEVELS, np.float64), found.mu, found.sigma, found.lapse)
    again = np.random.default_rng(8).binomial(asked, share, (300, 8))
    octaves = np.log2([fit(LEVELS, row.tolist(), asked).jnd for row in again])
    width = math.log2(found.interval[1] / found.interval[0])
    of_95, of_90 = (np.ptp(np.quantile(octaves, [tail, 1.0 - tail])) for tail in (0.025, 0.05))
    assert abs(width / of_95 - 1.0) < 0.4 * (1.0 - of_90 / of_95), (width, of_95, of_90)


@pytest.mark.slow
@pytest.mark.parametrize("spread", [0.0, 0.5, 1.0])
def test_coverage_is_close_to_nominal(spread: float) -> None:
    assert 0.91 <= coverage(300, 400, spread) <= 0.985


def test_answers_that_say_nothing_of_the_threshold() -> None:
    above, below = fit(LEVELS, [30] * 8, [30] * 8, 50), fit(LEVELS, [15] * 8, [30] * 8, 50)
    assert (above.status, above.jnd) == ("above", math.inf) and above.interval == (math.inf, math.inf)
    assert (below.status, below.jnd) == ("below", 0.0)
    worse = fit(LEVELS, [0] * 8, [30] * 8)
    assert worse.status == "below" and math.isfinite(worse.log_likelihood)


def test_levels_without_answers_and_any_order() -> None:
    correct = drawn(60.0, 1.5, 48, 3)
    whole = fit(LEVELS, correct, [48] * 8)
    more = fit([*LEVELS[::-1], 1000], [*correct[::-1], 0], [48] * 8 + [0])
    assert more.jnd == pytest.approx(whole.jnd) and more.trials == whole.trials


@pytest.mark.parametrize(
    ("levels", "correct", "trials", "message"),
    [
        ((8,), (3,), (4,), "answers at two levels at least, got 1"),
        ((8, 27), (3, 0), (4, 0), "answers at two levels at least, got 1"),
        ((8, 27), (5, 2), (4, 4), "between 0 and all answers"),
        ((0, 27), (3, 2), (4, 4), "levels of at least 1 sample"),
        ((8, 27), (3,), (4, 4), "as many levels as counts"),
    ],
)
def test_what_cannot_be_fitted(levels, correct, trials, message: str) -> None:
    with pytest.raises(FitError, match=message):
        fit(levels, correct, trials)


def test_paired_tests() -> None:
    rng = np.random.default_rng(2)
    a = rng.random(30)
    found = paired((a + 0.2 + 0.05 * rng.standard_normal(30)).tolist(), a.tolist())
    assert found is not None and found.degrees == 29 and found.p < 1e-6 and found.t > 5.0
    assert found.mean_difference == pytest.approx(0.2, abs=0.05)
    assert paired([0.5], [0.4]) is None and paired([0.5, 0.6], [0.5, 0.6]) is None
    with pytest.raises(FitError):
        paired([0.5], [0.4, 0.3])


@pytest.mark.parametrize(("jnd", "sigma"), [(30.0, 1.0), (100.0, 2.0)])
def test_psignifit_finds_the_same_threshold(jnd: float, sigma: float) -> None:
    pytest.importorskip("psignifit")
    correct, trials = drawn(jnd, sigma, 144, 4), [144] * 8
    ours, theirs = fit(LEVELS, correct, trials, 200), peer_fit(LEVELS, correct, trials)
    low, high = ours.interval or (0.0, 0.0)
    assert theirs.jnd == pytest.approx(ours.jnd, rel=0.15)
    assert theirs.interval[0] < ours.jnd < theirs.interval[1] and low < theirs.jnd < high
    assert (
        0.6 < math.log(theirs.interval[1] / theirs.interval[0]) / math.log(high / low) < 3.0
    )  # it is unsure of lapses too


def test_without_psignifit_there_is_one_line(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "psignifit", None)
    with pytest.raises(InputError, match=r"expected the package psignifit, found none; the extra 'psignifit'"):
        peer_fit(LEVELS, [10] * 8, [20] * 8)


def test_guess_rate_and_threshold_are_those_of_the_task() -> None:
    """Four alternatives: a share of 1/4 by chance; exact counts of a known function give its threshold."""
    rule = Rule(0.25, 0.6)
    levels = np.array([1.0, 4.0, 16.0, 64.0, 256.0])
    asked = np.full(5, 100_000)
    right = np.round(asked * correct_share(levels, 4.0, 1.5, 0.02, rule.guess)).astype(int)
    found = fit(levels.tolist(), right.tolist(), asked.tolist(), rule=rule)
    expected = threshold_samples(4.0, 1.5, 0.02, rule)
    assert float(correct_share(np.array([expected]), 4.0, 1.5, 0.02, rule.guess)[0]) == pytest.approx(0.6)
    assert found.jnd == pytest.approx(expected, rel=0.02)
    assert fit(levels.tolist(), right.tolist(), asked.tolist()).jnd != pytest.approx(expected, rel=0.1)
    for guess, threshold in ((0.5, 0.4), (0.95, 0.99), (0.5, 0.95)):
        with pytest.raises(ConfigError, match="expected"):
            Rule(guess, threshold)
