"""The tests that are run for changed files."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import changed
from tests.changed import chosen_for, nearest, used_by

FILES = {
    "tsar/deep.py": "",
    "tsar/middle.py": "from tsar.deep import thing\nfrom tsar import named",
    "tsar/named.py": "",
    "tsar/table.py": 'TABLE = {"late": "tsar.late:Late"}',
    "tsar/late.py": "",
    "tsar/native/grip.h": "",
    "tsar/lonely.py": "",
    "scripts/run.py": 'command("tsar.middle")',
    "tests/builders.py": "import tsar.table",
    "tests/conftest.py": "",
    "tests/tsar/conftest.py": "",
    "tests/tsar/test_middle.py": "from tsar.middle import other",
    "tests/tsar/test_named.py": "",
    "tests/tsar/test_builders.py": "from tests.builders import built",
    "tests/scripts/test_all.py": 'call("run.py")',
}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("checkout")
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


@pytest.mark.parametrize(
    ("file", "expected"),
    [
        ("tsar/middle.py", {"tests/tsar/test_middle.py"}),
        ("tsar/deep.py", {"tests/tsar/test_middle.py"}),
        ("tsar/named.py", {"tests/tsar/test_middle.py", "tests/tsar/test_named.py"}),
        ("tsar/late.py", {"tests/tsar/test_builders.py"}),
        ("tests/builders.py", {"tests/tsar/test_builders.py"}),
        ("scripts/run.py", {"tests/scripts/test_all.py"}),
        ("tests/tsar/conftest.py", {"tests/tsar"}),
        ("tests/tsar/test_named.py", {"tests/tsar/test_named.py"}),
        ("tests/tsar/test_gone.py", set()),
        ("tsar/native/grip.h", {"tests/tsar"}),
        ("docs/concepts.md", {"tests/test_docs.py"}),
        ("Makefile", set()),
        ("tsar/lonely.py", {f"tests/tsar/test_{name}.py" for name in ("middle", "named", "builders")}),
    ],
)
def test_the_nearest_tests_are_run(root: Path, file: str, expected: set[str]) -> None:
    assert chosen_for(root, file, used_by(root)) == expected


def test_where_many_are_as_near_those_of_the_room_are_run(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    near, far = "tests/tsar/test_named.py", [f"tests/scripts/test_{number}.py" for number in range(3)]
    monkeypatch.setattr(changed, "FILES_MOST", 3)
    assert chosen_for(root, "tsar/named.py", {"tsar/named.py": [near, *far]}) == {near}


def test_modules_of_the_project_have_tests() -> None:
    users = used_by(changed.ROOT)
    known = "tsar/morton.py", "tsar/policies/late.py", "analysis/ablation/command.py"
    assert all(nearest(file, users) for file in known)
    assert "tests/tsar/test_morton.py" in chosen_for(changed.ROOT, "tsar/morton.py", users)
