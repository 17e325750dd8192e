"""Convert a scene file of one renderer to that of another, and report what could not be carried over."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.conversion.convert_command")

if __name__ == "__main__":
    run_process(main)
