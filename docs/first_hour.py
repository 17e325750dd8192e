"""Times a newcomer's first hour: clone, install, first picture, page of the demo. No kernels are compiled before, and
pip's cache is empty.

Usage: python docs/first_hour.py FOLDER [REVISION]

Each command has a line: seconds from the start to its end, how long it took, and processor time of it and its children.
The last line says the revision, and how busy the machine was.
"""

from __future__ import annotations

import argparse
import datetime
import os
import subprocess
import sys
import time
from pathlib import Path

import psutil

HERE = Path(__file__).resolve().parent.parent
COMMANDS = (
    ("make", ".venv/.base"),
    (".venv/bin/python", "scripts/render.py", "fly-by", "--out", "out/first"),
    ("make", "demo"),
)


def processor_s() -> float:
    """Processor seconds of all children that have ended."""
    spent = os.times()
    return spent.children_user + spent.children_system


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder for the clone, which must not exist")
    parser.add_argument("revision", nargs="?", default="HEAD", help="what is checked out in it")
    given = parser.parse_args()
    folder = given.folder.resolve()
    if folder.exists():
        parser.error(f"folder: expected none, got {folder}")
    asked = subprocess.run(["git", "rev-parse", given.revision], cwd=HERE, check=True, capture_output=True)
    commit = asked.stdout.decode().strip()
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    environment |= {name: str(folder / ".cache" / name) for name in ("WARP_CACHE_PATH", "PIP_CACHE_DIR")}
    begun, busy = time.monotonic(), psutil.cpu_times()
    print("| command | ends after, s | takes, s | of processor time, s |\n|---|---|---|---|")

    def take(command: tuple[str, ...], where: Path) -> None:
        before, spent = time.monotonic(), processor_s()
        subprocess.run(command, cwd=where, env=environment, check=True, stdout=sys.stderr)
        now = time.monotonic()
        row = (f"`{' '.join(command)}`", f"{now - begun:.0f}", f"{now - before:.0f}", f"{processor_s() - spent:.0f}")
        print("| " + " | ".join(row) + " |", flush=True)

    take(("git", "clone", "--quiet", str(HERE), str(folder)), HERE)
    subprocess.run(["git", "checkout", "--quiet", commit], cwd=folder, check=True)
    for command in COMMANDS:
        take(command, folder)
    after = psutil.cpu_times()
    used = sum(after) - sum(busy) - (after.idle - busy.idle)
    print(f"\nRevision {commit[:7]}, {datetime.date.today()}, load {os.getloadavg()[0]:.1f} at the end.")
    print(f"These commands did {processor_s():.0f} s of the {used:.0f} s of work of {psutil.cpu_count()} cores.")


if __name__ == "__main__":
    main()
