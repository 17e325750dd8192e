"""Render one picture for each effect of the ray tracer, and a sheet of them all."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.tracer.gallery_command")

if __name__ == "__main__":
    run_process(main)
