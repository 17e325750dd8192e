"""The stages of ``tsar`` beside its tracing."""

from __future__ import annotations

import pytest

from analysis.bench.policy import ALL_ELSE, REST, TRACING, divided, policy_rows, timed
from tsar.filtering.records import Change, Estimates
from tsar.stages import REFERENCE


def test_a_cycle_is_divided_without_a_remainder() -> None:
    whole = {"selection": 5.0, "tracing": 3.0, "response": 2.0, "reconstruction": 1.5}
    found = divided(whole, {"advanced": 3.0, "chosen": 1.0, "taken_in": 1.5, "displayed": 1.0})
    assert found[TRACING] == 3.0 and found[ALL_ELSE] == 8.5 and found[REST] == 2.0
    assert sum(found.values()) - found[ALL_ELSE] == sum(whole.values())


def test_stages_note_their_seconds_and_do_the_same() -> None:
    seconds: dict[str, float] = {}
    estimates, rate = Estimates.empty(16), Change.empty(16).rate
    shown, remaining = timed(REFERENCE, seconds).filtering.displayed(estimates, None, rate, 0.1)
    wanted = REFERENCE.filtering.displayed(estimates, None, rate, 0.1)
    assert shown.equal(wanted[0]) and remaining.equal(wanted[1])
    assert set(seconds) == {"displayed"} and seconds["displayed"] > 0.0


@pytest.mark.parametrize(("all_else", "met"), [(1.5, True), (2.0, False)])
def test_the_share_is_held_to_its_limit(all_else: float, met: bool) -> None:
    cycles = [{TRACING: 3.0, REST: all_else, ALL_ELSE: all_else}] * 3
    *stages, share = policy_rows("scene", cycles)
    assert [row.ours for row in stages] == [3000.0, 1e3 * all_else, 1e3 * all_else]
    assert share.met is met and share.ours == pytest.approx(all_else / 3.0)
