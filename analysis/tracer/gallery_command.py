"""Render one picture for each effect of the ray tracer, and a sheet of them all.

Examples: python scripts/gallery.py --out out/gallery
          python scripts/gallery.py glass depth-of-field --samples 256 --out out/two
"""

from __future__ import annotations

from analysis.command.cli import InputError, parse
from analysis.tracer.options import GalleryOptions
from tsar.named import not_among


def main() -> None:
    """Parses, renders, prints the cost of each picture."""
    options = parse(GalleryOptions, __doc__ or "")
    from scenes.effects.scenes import EFFECTS

    for name in options.effects:
        if name not in EFFECTS:  # before anything that takes long to load
            raise InputError(f"effects: {not_among(name, EFFECTS)}")
    from analysis.command.console import show
    from analysis.tracer.gallery import effect_table
    from analysis.tracer.run import gallery

    found = gallery(options)
    show(effect_table(found["effects"]), f"written to {options.out}: pictures, gallery.jpg, summary.json")
