"""The live view: drive a camera through a scene, and see a framed renderer and a policy beside each other."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.live.command")

if __name__ == "__main__":
    run_process(main)
