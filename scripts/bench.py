"""Measure the speed of the simulator beside Embree, Mitsuba 3 and PyWavelets, and the overhead of its stages."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.bench.command")

if __name__ == "__main__":
    run_process(main)
