"""Run the suitability study: five inputs at sixteen settings, over seeds and phases, beside the thesis' results."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.suitability.command")

if __name__ == "__main__":
    run_process(main)
