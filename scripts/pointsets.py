"""Measure point sets and draw figures 4, 5, 7 and 9 of the motion-blur perception thesis from them."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.tracer.pointsets_command")

if __name__ == "__main__":
    run_process(main)
