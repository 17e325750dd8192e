"""Render one picture for each effect of the ray tracer, and a sheet of them all.

Examples: python scripts/gallery.py --out out/gallery
          python scripts/gallery.py glass depth-of-field --samples 256 --out out/two
"""

from __future__ import annotations

from analysis.command.cli import bad_input, full_disk, parse
from analysis.command.ownership import own_folder
from analysis.storage.files import write_json
from analysis.tracer.options import GalleryOptions


def main() -> None:
    """Parses, renders, prints what each picture took."""
    options = parse(GalleryOptions, __doc__ or "")
    from analysis.tracer.gallery import render_gallery, sample_plan

    with bad_input():
        plan = sample_plan(options)
        own_folder(options.out, "out")
    from analysis.command.progress import bars
    from analysis.storage.provenance import provenance
    from renderer.film.files import FilmError

    with bad_input(), full_disk(options.out, FilmError), bars() as shown:
        found = render_gallery(options, plan, shown.task)
        source = provenance(found["config"], seed=options.seed, device=options.device)
        write_json(options.out / "summary.json", {**found, "provenance": source})
    for name, each in found["effects"].items():
        kernels = "packets" if each["packets"] else f"{len(each['features'])} features"
        print(f"{name:20} {each['wall_s']:6.2f} s  {each['samples_per_s'] / 1e6:5.2f} M samples/s  {kernels}")
    print(f"pictures, gallery.jpg and summary.json in {options.out}")
