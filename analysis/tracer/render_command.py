"""Render a frame or a sequence of a scene or a model.

Examples: python scripts/render.py fly-by --time-s 1 --out out/still
          python scripts/render.py chase --frames 60 --format mp4 --out out/chase
          python scripts/render.py moving-object --samples 125 --point-set stratified --out out/blur
          python scripts/render.py car.glb --size 800x600 --samples 64 --out out/car
          python scripts/render.py car.glb --camera 3 1 4 0 0.5 0 --environment sky.hdr --out out/car
          python scripts/render.py car.glb --integrator path --samples 256 --out out/car
          python scripts/render.py glass --explain
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.command.extras import require_extra
from analysis.tracer.render_options import RenderOptions


def main() -> None:
    """Parses, renders, prints the names of the files."""
    options = parse(RenderOptions, __doc__ or "")
    require_extra(*(("denoise",) if options.denoise else ()))
    options.require_found(options.scene)
    from analysis.command.console import show
    from analysis.tracer.run import explained, opened, render

    scene, losses = opened(options)
    show(*losses)
    if options.explain:
        show(*explained(scene))
        return
    found = render(options, scene, losses)
    show(*found.get("later_losses", ()))
    counts = f"{found['rendered_now']} rendered now, {found['nonfinite']} values not finite"
    show(f"{options.frames} frames ({counts}) in {options.out}")
