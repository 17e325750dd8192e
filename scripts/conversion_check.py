"""Renders converted scenes with Mitsuba 3 and LuxCore and compares their pictures.

Example: python scripts/conversion_check.py scene.xml other.lxs --out out/conversion-check
"""

from __future__ import annotations

import dataclasses
import sys
from itertools import count
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.cli import bad_input, parse, run_cli
from analysis.conversion_check import CheckOptions
from analysis.files import atomic, writable_folder, write_json

ROOT = Path(__file__).resolve().parent.parent


def main() -> None:
    """Parses, converts, renders, prints the table."""
    options = parse(CheckOptions, __doc__ or "")
    with bad_input():
        writable_folder(options.out, "out")
    import pandas as pd

    from analysis.conversion_check import checked
    from analysis.progress import bars
    from analysis.records import provenance

    config = dataclasses.asdict(options)
    with bad_input(), bars() as shown:
        done, number = shown.task("scenes", len(options.scenes)), count(1)
        table = pd.DataFrame(checked(options, lambda: done(next(number))))
        with atomic(options.out / "table.csv") as path:
            table.to_csv(path, index=False)
        source = provenance(ROOT, config, seed=0)
        write_json(
            options.out / "summary.json", {"rows": table.to_dict("records"), "config": config, "provenance": source}
        )
    print(table.round(4).to_string(index=False))
    print(f"written to {options.out}")


if __name__ == "__main__":
    run_cli(main)
