"""Runs docs/tutorial.py piece by piece and writes the page: the text, the code, what it prints and what it draws.

Usage: python docs/tutorial_page.py [--small] [FOLDER]

Lines of comments at the margin are text, all between them is code. A picture that a piece of code writes follows it.
With --small, smaller numbers replace those at the beginning of the script.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = ROOT / "docs/tutorial.py"
SETTINGS = "SECONDS, SIDE_PX, BATCH = 1.0, 256, 64"
SMALL = "SECONDS, SIDE_PX, BATCH = 0.6, 64, 4"
PICTURE = re.compile(r'"(out/[\w/-]+\.png)"')


def pieces(source: str) -> list[tuple[bool, str]]:
    """Text (true) and code (false) in turn."""
    found: list[tuple[bool, list[str]]] = []
    for line in source.splitlines():
        is_text = line.startswith("#")
        if not found or (line and found[-1][0] != is_text):
            found.append((is_text, []))
        found[-1][1].append(line[2:] if is_text else line)
    return [(is_text, "\n".join(lines).strip("\n")) for is_text, lines in found]


def written(source: str, pictures: Path) -> str:
    """The page. Runs the code in the current folder; pictures go to ``pictures``, as JPEG."""
    names: dict[str, Any] = {"__name__": "__main__"}
    page = ["<!-- docs/tutorial_page.py writes this page from docs/tutorial.py -->"]
    for is_text, piece in pieces(source):
        if is_text:
            page.append(piece)
            continue
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(piece, SCRIPT.name, "exec"), names)
        page.append(f"```python\n{piece}\n```")
        shown = printed.getvalue().rstrip()
        if shown:
            page.append(f"```text\n{shown}\n```")
        for path in PICTURE.findall(piece):
            target = pictures / f"tutorial-{Path(path).stem}.jpg"
            Image.open(path).convert("RGB").save(target, quality=88, optimize=True)
            page.append(f"![{Path(path).stem}](pictures/{target.name})")
    return "\n\n".join(page) + "\n"


def main() -> None:
    """Writes tutorial.md and pictures/ into a folder, docs unless one is named."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "docs", help="destination")
    parser.add_argument("--small", action="store_true", help="smaller and shorter runs, for tests")
    asked = parser.parse_args()
    source = SCRIPT.read_text(encoding="utf-8")
    if asked.small:
        assert SETTINGS in source, f"{SCRIPT.name}: expected the line {SETTINGS!r}"
        source = source.replace(SETTINGS, SMALL)
    folder = asked.folder.resolve()
    (folder / "pictures").mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        page = written(source, folder / "pictures")
        os.chdir(folder)
    (folder / "tutorial.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
