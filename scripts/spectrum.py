"""Measure what the error estimate rests on."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_cli
from analysis.spectrum.command import main

if __name__ == "__main__":
    run_cli(main)
