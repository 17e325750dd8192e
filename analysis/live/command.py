"""The live view: drive a camera through a scene, and see a framed renderer and a policy beside each other.

Examples: python scripts/live.py fly-by
          python scripts/live.py chase --left thesis --right tsar --resolution-px 256
          python scripts/live.py box.xml --camera-path turntable --port 0
          python scripts/live.py fly-by --bench
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.command.start import first_imports
from analysis.live.options import LiveOptions
from analysis.study.view_options import require_scene


def main() -> None:
    """Parses; shows the page until Ctrl-C, or measures cycle rates and prints them."""
    options = parse(LiveOptions, __doc__ or "")
    require_scene(options.input)  # before anything that takes long to load
    with first_imports():
        from analysis.command.console import show
        from analysis.live.bench import cycle_rates
        from analysis.live.run import watched
    if options.bench:
        show(*cycle_rates(options))
    else:
        watched(options)
