"""The motion-blur perception study: render its stimuli, have observers answer, fit their psychometric functions."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.perception.command")

if __name__ == "__main__":
    run_process(main)
