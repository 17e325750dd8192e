"""Made-up results of a suitability study."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.suitability.runs import Run
from analysis.suitability.tables import RunResult

TIMES = 20


def result(run: Run, mse, **columns) -> RunResult:
    """A result with errors as given, a number or one per time."""
    errors = np.broadcast_to(np.asarray(mse, float), (TIMES,)).copy()
    table = pd.DataFrame({"time_s": np.arange(TIMES) / 30, "mse": errors, "log_mse": errors})
    for name, value in {"flip": errors, "ssim": 1 - errors, "flicker": 0.0, **columns}.items():
        table[name] = value
    summary = {"jod": 10 - 100 * float(errors.mean()) if run.case.jod_span_s else None, "cycles": 9, "cycle_s": 0.01}
    return RunResult(run, {**summary, "invariants": {"ok": True}, "nonfinite_samples": 0}, table)
