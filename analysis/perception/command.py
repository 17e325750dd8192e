"""The motion-blur perception study: render its stimuli, have observers answer, fit their psychometric functions.

Examples: python scripts/perception.py stimuli --width-px 128 --frames 20 --out out/perception
          python scripts/perception.py simulate out/perception --out out/perception-simulated
          python scripts/perception.py serve ANNA --stimuli out/perception --out out/anna
          python scripts/perception.py adaptive fly-by chase --out out/perception-adaptive
          python scripts/perception.py analyse out/perception-simulated/trials-simulated.parquet
          python scripts/perception.py recover
"""

from __future__ import annotations

import dataclasses

from analysis.command.cli import bad_input, full_disk, parse
from analysis.command.extras import require_extra
from analysis.command.ownership import own_folder
from analysis.perception.options import (
    AdaptiveOptions,
    RecoverOptions,
    ServeOptions,
    SimulateOptions,
    Step,
    StimuliOptions,
)
from analysis.storage.files import write_json

NEEDS = {SimulateOptions: ("perception",), AdaptiveOptions: ("study", "perception")}


def main() -> None:
    """Parses, runs one step of the study, prints what came out."""
    options = parse(Step, __doc__ or "")  # type: ignore[arg-type]
    require_extra(*NEEDS.get(type(options), ()))
    with bad_input():
        own_folder(options.out, "out")
    from analysis.command.progress import bars
    from analysis.perception import steps
    from analysis.storage.provenance import provenance
    from renderer.film.files import FilmError

    config = dataclasses.asdict(options)
    source = provenance(config, seed=options.seed)

    with bad_input(), full_disk(options.out, FilmError), bars() as shown:
        if isinstance(options, StimuliOptions):
            found, text = steps.stimuli(options, shown.task)
        elif isinstance(options, SimulateOptions):
            found, text = steps.simulate(options, shown.task)
        elif isinstance(options, RecoverOptions):
            found, text = steps.recover(options, shown.task)
        elif isinstance(options, AdaptiveOptions):
            found, text = steps.adaptive(options, shown.task)
        elif isinstance(options, ServeOptions):
            found, text = steps.serve(options, shown.task, shown.say)
        else:
            found, text = steps.analyse(options, shown.task)
        write_json(options.out / "summary.json", {**found, "config": config, "provenance": source})
    print(f"{text}\nwritten to {options.out}")
