"""The parts of the policy that can be changed, and the runs that follow."""

from __future__ import annotations

import dataclasses

import pytest

from analysis.ablation.options import AblationOptions
from analysis.ablation.parts import WHOLE, all_parts, chosen_parts
from analysis.ablation.runs import rivals_of, runs
from analysis.study.cases import SCALES
from analysis.study.inputs import INPUTS
from tsar.config import ConfigError, TsarConfig
from tsar.filtering.options import DEFAULT
from tsar.policies import RIVALS

OPTIONS = AblationOptions(inputs=("fly-by", "chase"), rows=(6, 7), repetitions=2, rivals=("afr", "framed-half"))


def test_every_switch_is_put_off_alone() -> None:
    switches = {one.name for one in dataclasses.fields(DEFAULT) if isinstance(getattr(DEFAULT, one.name), bool)}
    off = [part.options for part in all_parts() if len(part.options) == 1 and part.options[0][0] in switches]
    assert sorted(off) == [((name, False),) for name in sorted(switches) if getattr(DEFAULT, name)]
    assert len(switches) >= 7


def test_every_part_changes_the_policy_and_no_two_are_alike() -> None:
    parts = all_parts()
    changed = [dataclasses.replace(DEFAULT, **dict(part.options)) for part in parts]
    assert DEFAULT not in changed and len(set(changed)) == len(parts)
    assert len({part.name for part in parts}) == len({part.words for part in parts} | {WHOLE}) - 1 == len(parts)
    assert all(part.options == tuple(sorted(part.options)) for part in parts)


def test_parts_are_chosen_by_name() -> None:
    assert chosen_parts(()) == all_parts()
    assert [part.name for part in chosen_parts(("smoothing", "jitter"))] == ["smoothing", "jitter"]
    with pytest.raises(ConfigError, match=r"^parts: expected one of .*jitter, .*, got 'magic'$"):
        chosen_parts(("magic",))
    with pytest.raises(ConfigError, match="none twice"):
        chosen_parts(("jitter", "jitter"))


def test_the_runs_of_the_study() -> None:
    parts = chosen_parts(("jitter", "latency"))
    found = runs(OPTIONS, parts)
    assert len(found) == 2 * 2 * 2 * (1 + 2 + 3) and rivals_of(OPTIONS) == ("framed", "afr", "framed-half")
    assert {run.case.policy for run in found} == {"tsar", *rivals_of(OPTIONS)}
    for run in found:
        case = run.case
        assert (case.budget_s is not None) == (run.label == WHOLE) and case.phase == run.repetition / 2
        assert bool(case.parts) == (run.label in {part.words for part in parts})
        if case.policy in ("tsar", "afr"):
            assert case.tsar == SCALES["quick"].config(run.row, TsarConfig(seed=run.repetition))
    latency = [run.case for run in found if run.label == parts[1].words]
    assert all(case.parts == (("latency_cycles", 3),) for case in latency)
    assert len({case.key("source") for case in {run.case for run in found}}) == len({run.case for run in found})


def test_the_defaults_are_the_five_inputs_beside_all_rivals() -> None:
    assert AblationOptions().inputs == INPUTS and rivals_of(AblationOptions()) == ("framed", *RIVALS)
