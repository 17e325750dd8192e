"""The live view: drive a camera through a scene, and see a framed renderer and a policy beside each other.

Examples: python scripts/live.py fly-by
          python scripts/live.py chase --left thesis --right tsar --resolution-px 256
          python scripts/live.py box.xml --camera-path turntable --port 0
          python scripts/live.py fly-by --bench
"""

from __future__ import annotations

from analysis.command.cli import bad_input, parse
from analysis.command.start import first_imports
from analysis.live.options import LiveOptions


def main() -> None:
    """Parses; shows the page until Ctrl-C, or measures cycle rates and prints them."""
    options = parse(LiveOptions, __doc__ or "")
    with first_imports(), bad_input():
        from scenes import catalog

        catalog.require_known(options.input)  # before anything that takes long to load
    with first_imports():
        from analysis.command.console import show
        from analysis.live.bench import cycle_rates
        from analysis.live.run import watched
    if options.bench:
        show(*cycle_rates(options))
    else:
        watched(options)
