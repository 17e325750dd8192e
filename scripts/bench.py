"""Measure how fast the simulator is beside Embree, Mitsuba 3 and PyWavelets, and how little its machinery costs."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.bench.command")

if __name__ == "__main__":
    run_process(main)
