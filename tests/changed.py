"""Runs the tests nearest to what changed: ``python -m tests.changed [FILE...]``.

Without files, these are the files that differ from the point where the branch left ``main``, committed or not. The
nearest tests of a module are those that import it; if there are none, those that import a module that imports it, and
so on. The test of the same name is always among them. If many are equally near, those of the mirroring folder are run.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

from tests.test_architecture import PACKAGES, ROOT, imports

ALWAYS = ("tests/test_architecture.py",)
FILES_MOST = 8
"""Most test files for one module if many are equally near: the rest is left to the whole suite."""
_PLACE = re.compile(r"[a-z_]\w*(\.\w+)+(:\w+)?")
"""A module, or ``module:attribute``, that is named in a string and imported at its first use; ``run.py`` is a
script."""


def used_by(root: Path) -> dict[str, set[str]]:
    """For each file of the packages and the tests, by its path, the files that import it or a name that it defines."""
    files = {
        path.relative_to(root).as_posix() for package in (*PACKAGES, "tests") for path in (root / package).rglob("*.py")
    }
    users = defaultdict(set)
    for file in files:
        tree = ast.parse((root / file).read_text(encoding="utf-8"))
        texts = (node.value for node in ast.walk(tree) if isinstance(node, ast.Constant))
        places = [text.replace(":", ".") for text in texts if isinstance(text, str) and _PLACE.fullmatch(text)]
        for name in (*(name for _, name in imports(tree, file)), *places):
            path = name.replace(".", "/")
            modules = f"{path}.py", f"{path.rpartition('/')[0]}.py", f"{path}/__init__.py", f"scripts/{name}"
            for candidate in modules:
                if candidate in files and candidate != file:
                    users[candidate].add(file)
    return users


def is_test(file: str) -> bool:
    return file.startswith("tests/") and Path(file).name.startswith("test_")


def nearest(file: str, users: Mapping[str, Iterable[str]]) -> set[str]:
    """The test files that reach a file by the fewest imports."""
    seen, ring = {file}, {file}
    while ring:
        found = {one for one in ring if is_test(one)}
        if found:
            return found
        ring = {user for one in ring for user in users.get(one, ())} - seen
        seen |= ring
    return set()


def mirrored(root: Path, file: str) -> tuple[str | None, str | None]:
    """The test file with a file's name, and the folder of tests that mirrors its folder; None if there is none.

    For a file that is not Python, the nearest folder above it that has tests.
    """
    parts = Path(file).parts[:-1]
    while parts and not (root / "tests" / Path(*parts)).is_dir():
        parts = parts[:-1]
    if not parts:
        return None, None
    folder = Path("tests", *parts)
    named = folder / f"test_{Path(file).stem}.py"
    return named.as_posix() if (root / named).is_file() else None, folder.as_posix()


def chosen_for(root: Path, file: str, users: Mapping[str, Iterable[str]]) -> set[str]:
    """The tests to run if a file changed; empty if no test reaches it.

    Args:
        root: the folder of the checkout.
        file: path below it, with forward slashes; the file may be gone.
        users: result of :func:`used_by` for the root.
    """
    if file.startswith("tests/") and Path(file).name == "conftest.py":
        return {str(Path(file).parent)}
    if is_test(file):
        return {file} if (root / file).is_file() else set()
    if file.startswith(("docs/", "README")) or file.endswith(".md"):
        return {"tests/test_docs.py"}
    named, folder = mirrored(root, file)
    if not file.endswith(".py"):
        return {folder} if folder else set()
    found = nearest(file, users)
    if len(found) > FILES_MOST:
        near = {one for one in found if folder and one.startswith(f"{folder}/")}
        found = set(sorted(near or found, key=lambda one: (one.count("/"), one))[:FILES_MOST])
    if not found and folder:
        found = {path.relative_to(root).as_posix() for path in (root / folder).glob("test_*.py")}
    return found | ({named} if named else set())


def changed(root: Path) -> list[str]:
    """Paths of the files that differ from where the branch left ``main``, and of new ones that git does not ignore."""

    def git(*arguments: str) -> list[str]:
        done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True)
        return done.stdout.splitlines() if done.returncode == 0 else []

    bases = (git("merge-base", "HEAD", name) for name in ("origin/main", "main", "HEAD"))
    base = next((found[0] for found in bases if found), "HEAD")
    return sorted({*git("diff", "--name-only", base), *git("ls-files", "--others", "--exclude-standard")})


def main(files: list[str]) -> int:
    """Runs the tests on all cores; returns the exit status."""
    import pytest

    files = files or changed(ROOT)
    if not files:
        print("nothing differs from the main branch; name files to run their tests")
        return 0
    users = used_by(ROOT)
    chosen = sorted(set(ALWAYS).union(*(chosen_for(ROOT, file, users) for file in files)))
    print(f"{len(files)} files changed; running {' '.join(chosen)}", flush=True)
    return int(pytest.main(["-n", "auto", "--dist", "worksteal", *chosen]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
