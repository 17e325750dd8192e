"""Compare brute force, kd-tree and tree of boxes by what a ray takes, or render the ray-tracer report's two images.

Examples: python scripts/accelerators.py --out out/accelerators
          python scripts/accelerators.py --image report-one report-two --out out/report
          python scripts/accelerators.py --image report-one --scale 0.2 --out out/report-small
"""

from __future__ import annotations

import dataclasses

from analysis.command.cli import bad_input, full_disk, parse
from analysis.command.ownership import own_folder
from analysis.storage.files import atomic, write_json
from analysis.tracer.options import AcceleratorOptions


def main() -> None:
    """Parses, measures or renders, prints a table or what each image took."""
    options = parse(AcceleratorOptions, __doc__ or "")
    from analysis.tracer.accelerators import lines, render_report_image, table

    with bad_input():
        own_folder(options.out, "out")
    from analysis.command.console import frame_table
    from analysis.command.progress import bars
    from analysis.page.figures import save
    from analysis.storage.provenance import provenance
    from analysis.tracer.plots_accelerators import tests_figure
    from renderer.film.files import FilmError, write_image

    config = dataclasses.asdict(options)
    found: dict = {"config": config, "provenance": provenance(config, seed=options.seed)}
    with full_disk(options.out, FilmError), bars() as shown:
        if options.image:
            images = {name: render_report_image(name, options, shown.task) for name in dict.fromkeys(options.image)}
            for name, (image, _) in images.items():
                for ending in (".png", ".exr"):
                    write_image(options.out / f"{name}{ending}", image)
            found["images"] = {name: facts for name, (_, facts) in images.items()}
        else:
            rows = table(options, shown.task)
            with atomic(options.out / "table.csv") as path:
                rows.to_csv(path, index=False)
            save(tests_figure(rows), options.out / "tests.png")
            found["rows"] = rows.to_dict("records")
        write_json(options.out / "summary.json", found)
    if options.image:
        print("\n".join(lines(list(found["images"].items()))))
    else:
        frame_table(rows)
    print(f"written to {options.out}")
