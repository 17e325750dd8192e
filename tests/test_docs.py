"""README and documentation are correct: links, commands and targets exist, and code runs."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
PAGES = [README, ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
# the site makes these from other files
MADE = {ROOT / "docs" / name for name in ("notation.md", "changelog.md", "contributing.md", "reference/index.md")}

LINK = re.compile(r"\]\((?!https?:|mailto:|#)([^)#\s]+)")


def test_readme_is_short() -> None:
    assert len(README.read_text().splitlines()) <= 150


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    targets = {(page.parent / link).resolve() for link in LINK.findall(page.read_text())}
    assert [str(target) for target in targets if not target.exists() and target not in MADE] == []


def test_pictures_are_used() -> None:
    text = "".join(page.read_text() for page in PAGES)
    assert [path.name for path in (ROOT / "docs/pictures").iterdir() if f"pictures/{path.name}" not in text] == []


def test_commands_and_targets_exist() -> None:
    text = "".join(page.read_text() for page in PAGES)
    scripts = set(re.findall(r"(?<!tests/)scripts/(\w+\.py)", text))
    targets = set(re.findall(r"(?m)(?:`|^)make ([a-z-]+)", text))
    assert {name for name in scripts if not (ROOT / "scripts" / name).is_file()} == set()
    assert targets - set(re.findall(r"(?m)^([a-z-]+):", (ROOT / "Makefile").read_text())) == set()
    assert len(scripts) > 10 and len(targets) > 4


def test_tests_that_pages_name_exist() -> None:
    text = "".join(page.read_text() for page in PAGES)
    named = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", text)
    missing = [
        f"{file}::{name}"
        for file, name in named
        if not (ROOT / file).is_file() or (name and f"def {name}(" not in (ROOT / file).read_text())
    ]
    assert len(named) > 30 and missing == []


def test_the_python_of_the_readme_runs(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)
    assert len([line for line in code.splitlines() if line]) <= 10
    command = [sys.executable, "-c", code]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert all(re.search(rf"(?m)^{name} +0\.0", done.stdout) for name in ("tsar", "framed", "thesis"))
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"small", "shown.png", "report.html", "glass.png"}


def tutorial(folder: Path, *options: str) -> str:
    """The page of the tutorial as its script makes it now."""
    command = [sys.executable, str(ROOT / "docs/tutorial_page.py"), *options, str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=3000)
    assert done.returncode == 0, done.stderr
    return (folder / "tutorial.md").read_text()


def test_the_tutorial_runs_small(tmp_path: Path) -> None:
    """Its text and code are those of the page; its output has the same form, and every picture is drawn."""
    page = (ROOT / "docs/tutorial.md").read_text()
    settings = re.findall(r"(?m)^SECONDS, .*$", page)
    found = re.sub(r"(?m)^SECONDS, .*$", "".join(settings), tutorial(tmp_path, "--small"))
    printed = re.compile(r"(?s)(?<=```text\n).*?(?=\n```)")
    assert len(settings) == 1 and printed.sub("", found) == printed.sub("", page)
    lines = [[shown.count("\n") for shown in printed.findall(text)] for text in (found, page)]
    assert lines[0] == lines[1] and len(lines[0]) == 5
    drawn = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert drawn == {path.name for path in (ROOT / "docs/pictures").glob("tutorial-*")} and len(drawn) == 5


def result_tables() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "docs/result_tables.py"))


def test_tables_of_a_study_replace_those_of_its_page() -> None:
    page = "# Page\n\n| a | b |\n|---|---|\n| old | 1 |\n\nSaid.\n\n| c |\n| --- |\n| stays |\n"
    written = "**A title**\n\n| a | b |\n| --- | --- |\n| new | 2 |\n| newer | 3 |\n\n| d |\n| --- |\n| other |\n"
    made, common = result_tables()["replaced"](page, written)
    assert common == ["a | b"]
    assert made == page.replace("|---|---|\n| old | 1 |\n", "| --- | --- |\n| new | 2 |\n| newer | 3 |\n")
    with pytest.raises(ValueError, match=r"a \| b: expected 1 tables of these columns, got 2"):
        result_tables()["replaced"](page + "\n| a | b |\n|---|---|\n", written)


@pytest.mark.parametrize("page", sorted((ROOT / "docs/results").glob("*.md")), ids=lambda page: page.stem)
def test_tables_of_a_page_are_found_and_nothing_else_changes(page: Path) -> None:
    text = page.read_text()
    made, common = result_tables()["replaced"](text, text)
    assert made == text and len(common) == len(result_tables()["tables_of"](text))


@pytest.mark.slow
def test_the_tutorial_prints_what_its_page_says(tmp_path: Path) -> None:
    assert tutorial(tmp_path) == (ROOT / "docs/tutorial.md").read_text()


@pytest.mark.slow
def test_figures_are_those_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["figures.py", str(tmp_path)])
    runpy.run_path(str(ROOT / "docs/figures.py"), run_name="__main__")
    drawn = {path.name for path in tmp_path.iterdir()}
    assert drawn == set(re.findall(r"pictures/(\S+\.png)", (ROOT / "docs/concepts.md").read_text()))
