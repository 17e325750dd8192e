"""Draw the map of workloads: which policy to use where, by what a sample costs, how much moves, and the resolution."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.workloads.command")

if __name__ == "__main__":
    run_process(main)
