"""Compare brute force, kd-tree and tree of boxes by the cost of a ray, or render the ray-tracer report's two images."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.tracer.accelerators_command")

if __name__ == "__main__":
    run_process(main)
