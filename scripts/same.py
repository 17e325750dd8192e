"""Tell whether two folders of results are the same: every number, table and picture, except measured seconds."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import run_process
from analysis.command.later import command

main = command("analysis.storage.command")

if __name__ == "__main__":
    run_process(main)
