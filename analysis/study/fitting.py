"""Whether the cycles of a policy fit into a case, before anything is rendered."""

from __future__ import annotations

import torch

from analysis.study.cases import Case
from analysis.study.runs import Machine, require_pace
from tsar.policies import POLICIES
from tsar.policy import Setting
from tsar.types import Viewpoint

_EYE = torch.eye(3, dtype=torch.float64)
_STILL = Viewpoint(
    0.0, torch.zeros(1, dtype=torch.int64), _EYE[None], 0 * _EYE[:1], _EYE, 0 * _EYE[0], "perspective", 0.5, 0.5
)
"""Nothing moves: the price of a policy does not depend on it."""


def fitting(case: Case) -> Case:
    """The case, if cycles of its policy fit into it, at the price for scenes whose samples draw no random numbers.

    Raises:
        ConfigError: they do not.
    """
    policy = POLICIES[case.policy](Setting(case.tsar, view=lambda time_s: _STILL))
    machine = Machine(case.ledger, case.capacity, case.cost, case.samples_per_s)
    span_s = case.start_s, case.start_s + case.scale.seconds
    require_pace(case.policy, policy.price, machine, span_s, case.tsar.warmup_cycles)
    return case
