"""Render a picture in tiles over processes or machines, or measure how much faster more workers are.

Examples: python scripts/tiles.py report-one --out out/tiles
          python scripts/tiles.py glass --farm.scheduler tcp://host:8786 --out out/far
          python scripts/tiles.py report-one --study 1 2 4 --out out/speedup
"""

from __future__ import annotations

import dataclasses
import itertools

from analysis.command.cli import bad_input, full_disk, parse
from analysis.command.cluster import ClusterOptions, connected
from analysis.command.extras import require_extra
from analysis.command.ownership import own_folder
from analysis.storage.files import write_json
from analysis.tracer.options import TileOptions


def main() -> None:
    """Parses, renders or measures, prints what it took."""
    options = parse(TileOptions, __doc__ or "")
    require_extra("study")
    from analysis.tracer.tiles import chunks_of, picture_of, render_resumed

    farm = ClusterOptions(workers=max(options.study)) if options.study else options.farm
    with bad_input():
        picture = picture_of(options, 1 if options.study else farm.threads)
        own_folder(options.out, "out")
    import pandas as pd

    from analysis.command.console import frame_table
    from analysis.command.progress import bars
    from analysis.storage.provenance import provenance
    from analysis.tracer.tile_speedup import study
    from renderer.film.files import FilmError, write_image

    config = dataclasses.asdict(options)
    chunks = chunks_of(picture, options.chunk_tiles)
    found: dict = {"config": config, "provenance": provenance(config, scene=picture.scene, seed=options.seed)}
    with bad_input(), connected(farm) as client, full_disk(options.out, FilmError), bars() as shown:
        if options.study:
            turns = len({1, *options.study}) * options.repetitions
            done, number = shown.task("turns", turns), itertools.count(1)
            found |= study(client, picture, chunks, options.study, options.repetitions, lambda: done(next(number)))
        else:
            image, facts = render_resumed(client, picture, options, shown.task("chunks", len(chunks)))
            found |= {**facts, "nonfinite": write_image(options.out / f"{picture.scene}.png", image)}
            write_image(options.out / f"{picture.scene}.exr", image)
        write_json(options.out / "summary.json", found)
    if options.study:
        frame_table(pd.DataFrame(found["rows"]))
        predicted, reported = found["predicted"], found["predicted"]["reported"]
        beside = f" (report: {reported:.1f})" if reported else ""
        print(f"same bits from all: {found['same_bits']}; by the model {predicted['workers']} workers with a core each "
              f"are {predicted['speedup']:.1f} times as fast as one{beside}")  # fmt: skip
    else:
        print(f"{found['chunks']} chunks ({found['chunks_rendered_now']} now) in {found['wall_s']:.1f} s, "
              f"{found['worker_s']:.1f} s of workers")  # fmt: skip
    print(f"written to {options.out}")
