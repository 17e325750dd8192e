"""The outcomes of the cases of a study."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from analysis.storage.source import Brought
from analysis.study.cases import Case
from analysis.study.evaluation import Resources, finished, times_of
from analysis.study.farm import describe_failures


@dataclass
class Outcomes:
    """Cases that were run, and their results on disk. Changes in place.

    Attributes:
        place: folder of the results.
        keys: keys of the results, by case.
        failures: reasons for failures, by case.
    """

    place: Resources
    keys: dict[Case, str] = field(default_factory=dict)
    failures: dict[Case, str] = field(default_factory=dict)

    def keep(self, keys: dict[Case, str], failures: dict[Case, str]) -> None:
        """Adds the outcomes of more cases."""
        self.keys |= keys
        self.failures |= failures

    def summary(self, case: Case) -> dict[str, Any] | None:
        """As :func:`analysis.study.evaluation.finished`."""
        return finished(self.keys[case], self.place)

    def summaries(self) -> dict[Case, dict[str, Any]]:
        """Summaries of all cases that succeeded, in order."""
        return {case: found for case in self.keys if (found := self.summary(case)) is not None}

    def times(self, case: Case) -> pd.DataFrame:
        """As :func:`analysis.study.evaluation.times_of`."""
        return times_of(self.keys[case], self.place)

    @property
    def reasons(self) -> dict[str, str]:
        """Reasons for failures, by the key of the result."""
        return {self.keys[case]: reason for case, reason in self.failures.items()}

    @property
    def added(self) -> list[Brought]:
        """The additions of other packages that the cases use, each once."""
        return list(dict.fromkeys(one for case in self.keys for one in case.added))

    def tell(self) -> None:
        """Prints the reasons for failures at once, because later steps may fail for the same reasons, such as a full
        disk."""
        for line in describe_failures(self.reasons):
            print(line, file=sys.stderr)
