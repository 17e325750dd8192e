"""Measure the worth of each part of the policy tsar, the terms of its error, and its distance to a perfect picture."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.ablation.command")

if __name__ == "__main__":
    run_process(main)
