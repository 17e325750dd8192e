"""Renders converted scenes with Mitsuba 3 and LuxCore and compares their pictures.

Examples: python scripts/conversion_check.py scene.xml other.lxs --out out/conversion-check
          python scripts/conversion_check.py --markers
"""

from __future__ import annotations

import dataclasses
from itertools import count

from analysis.command.cli import bad_input, parse
from analysis.command.extras import require_extra
from analysis.command.ownership import own_folder
from analysis.conversion.check import CheckOptions
from analysis.storage.files import atomic, write_json


def main() -> None:
    """Parses, converts, renders, prints the table."""
    options = parse(CheckOptions, __doc__ or "")
    require_extra("formats", "peers", "perception")
    with bad_input():
        own_folder(options.out, "out")
    import pandas as pd

    from analysis.command.progress import bars
    from analysis.conversion.check import checked
    from analysis.conversion.markers import marker_offsets
    from analysis.storage.provenance import provenance

    config = dataclasses.asdict(options)
    with bad_input(), bars() as shown:
        done, number = shown.task("scenes", len(options.scenes)), count(1)
        rows = checked(options, lambda: done(next(number)))
        markers = marker_offsets(options.out / "markers", options.limit_s) if options.markers else []
        for name, found in (("table", rows), ("markers", markers)):
            if found:
                with atomic(options.out / f"{name}.csv") as path:
                    pd.DataFrame(found).to_csv(path, index=False)
        source = provenance(config, seed=0)
        write_json(
            options.out / "summary.json", {"rows": rows, "markers": markers, "config": config, "provenance": source}
        )
    for found in (rows, markers):
        if found:
            brief = [{**row, "losses": len(row["losses"])} if "losses" in row else row for row in found]
            print(pd.DataFrame(brief).round(4).to_string(index=False))
    print(f"written to {options.out}")
