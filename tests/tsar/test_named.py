"""Tables of names: entries found, names refused, and the origin of an entry."""

from __future__ import annotations

from importlib.metadata import Distribution, EntryPoint, version
from pathlib import Path

import pytest

from tsar.checks import ConfigError
from tsar.named import Named, Origin


@pytest.fixture
def table() -> Named[object]:
    return Named("thing", "tests.things", {"root": "math:sqrt", "lost": "math:no_such", "own": len})


def test_an_entry_is_imported_when_it_is_asked_for(table: Named[object]) -> None:
    assert [*table] == ["root", "lost", "own"] and len(table) == 3 and "own" in table and "other" not in table
    assert table["own"] is len and table["root"](4.0) == 2.0  # type: ignore[operator]
    with pytest.raises(ConfigError, match="thing 'lost': math:no_such cannot be imported"):
        table["lost"]


def test_an_unknown_name_gets_the_known_ones_and_the_nearest(table: Named[object]) -> None:
    with pytest.raises(ConfigError, match=r"^thing: expected one of root, lost, own, got 'rot' \(nearest: root\)$"):
        table["rot"]
    with pytest.raises(ConfigError, match=r"^a.b: expected one of root, lost, own, got 'xyz'$"):
        table.require("xyz", "a.b")


def test_what_is_lent_is_given_back(table: Named[object]) -> None:
    table.add("more", max)
    with table.lent(own=min, more="math:floor", new=sum):
        assert table["own"] is min and not table.is_own("own") and [*table] == ["root", "lost", "own", "more", "new"]
        assert table.origin("more").module == "math"
    assert table["own"] is len and table.is_own("own") and table["more"] is max and "new" not in table


def test_an_entry_says_where_it_comes_from(table: Named[object]) -> None:
    import numpy

    table.add("array", numpy.array_equal)
    table.add("mine", test_what_is_lent_is_given_back)
    assert table.origin("array") == Origin("numpy", "numpy", version("numpy"))
    assert table.origin("mine") == Origin(__name__, None, None) and not table.is_own("mine")
    assert table.origin("root") == Origin("math", None, None) and table.is_own("root")


def test_installed_packages_add_entries_but_replace_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "METADATA").write_text("Metadata-Version: 2.1\nName: brings-things\nVersion: 3.2\n")
    bringer = Distribution.at(tmp_path)
    points = [EntryPoint(name, "math:floor", "tests.things")._for(bringer) for name in ("own", "new")]  # type: ignore[attr-defined]
    asked = []
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: asked.append(group) or points)
    table = Named("thing", "tests.things", {"own": len})
    assert table["own"] is len and asked == []  # nothing is searched for what is known
    with table.lent(more=max):
        assert "new" in table
    assert "more" not in table
    assert table["new"](1.5) == 1 and table.origin("new") == Origin("math", "brings-things", "3.2")  # type: ignore[operator]
    assert table["own"] is len and asked == ["tests.things"]
