"""Render a sequence in every combination of sampling levels, point sets and time filters of a job file."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.tracer.job_command")

if __name__ == "__main__":
    run_process(main)
