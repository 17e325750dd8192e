"""The motion-blur perception study: render its stimuli, have observers answer, fit their psychometric functions.

Examples: python scripts/perception.py stimuli --width-px 128 --frames 20 --out out/perception
          python scripts/perception.py simulate out/perception --out out/perception-simulated
          python scripts/perception.py serve ANNA --stimuli out/perception --out out/anna
          python scripts/perception.py adaptive fly-by chase --out out/perception-adaptive
          python scripts/perception.py analyse out/perception-simulated/trials-simulated.parquet
          python scripts/perception.py recover
          python scripts/perception.py figures
          python scripts/perception.py anomaly
"""

from __future__ import annotations

from analysis.command.cli import InputError, parse, require_files
from analysis.command.cluster import ClusterOptions
from analysis.command.extras import require_extra
from analysis.perception.options import (
    AdaptiveOptions,
    AnalyseOptions,
    ServeOptions,
    SimulateOptions,
    StepOptions,
    StimuliOptions,
)


def main() -> None:
    """Parses, runs one step of the study, prints the outcome."""
    options = parse(StepOptions, __doc__ or "")  # type: ignore[arg-type]
    if isinstance(options, AdaptiveOptions):
        require_extra("study")
    if isinstance(options, AnalyseOptions):
        require_files(*options.trials)
    if isinstance(options, StimuliOptions):
        require_files(*options.jobs)
        ClusterOptions(scheduler=options.scheduler).require_port()  # before slow imports
    if isinstance(options, (SimulateOptions, ServeOptions)):
        manifest = options.stimuli / "manifest.json"
        if not manifest.is_file():
            raise InputError(f"stimuli: expected {manifest}, written by the command 'stimuli' (it is missing)")
    from analysis.command.console import show
    from analysis.perception.run import run

    show(run(options), f"written to {options.out}")
