"""Render a picture in tiles over processes or machines, or measure the speed-up with more workers.

Examples: python scripts/tiles.py report-one --out out/tiles
          python scripts/tiles.py car.glb --samples 256 --out out/car
          python scripts/tiles.py glass --scheduler tcp://host:8786 --out out/far
          python scripts/tiles.py report-one --study 1 2 4 --out out/speedup
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.command.extras import require_extra
from analysis.tracer.options import TileOptions


def main() -> None:
    """Parses, renders or measures, prints the time."""
    options = parse(TileOptions, __doc__ or "")
    options.farm.require_port()  # before slow imports
    require_extra("study")
    options.require_found(options.scene)
    import pandas as pd

    from analysis.command.console import frame_table, show
    from analysis.tracer.run import losses_of, tiles
    from analysis.tracer.tile_speedup import described

    show(*losses_of(options))
    found = tiles(options)
    if options.study:
        show(frame_table(pd.DataFrame(found["rows"])), described(found))
    else:
        chunks = f"{found['chunks']} chunks ({found['chunks_rendered_now']} now)"
        show(f"{chunks} in {found['wall_s']:.1f} s, {found['worker_s']:.1f} s of workers")
    show(f"written to {options.out}")
