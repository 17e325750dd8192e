"""Vary slopes, offsets and bias of the error estimate (figs 7.23–7.25): best values, and flatness of the optimum."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.sensitivity.command")

if __name__ == "__main__":
    run_process(main)
