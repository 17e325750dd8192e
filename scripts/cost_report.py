"""Report the cost of an adaptive cycle and of a framed image: by the model of table 7.1, and on this machine."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.cost_report.command")

if __name__ == "__main__":
    run_process(main)
