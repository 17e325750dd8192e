"""Draw the map of workloads: the best policy by the price of a sample, the amount of motion, and the resolution."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.workloads.command")

if __name__ == "__main__":
    run_process(main)
