"""Measure the cost of fewer bits: everything that a policy keeps, and textures, in formats down to 8 bits."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.precision.command")

if __name__ == "__main__":
    run_process(main)
