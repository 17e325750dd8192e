"""The benchmark as a table, and two of them compared."""

import json
from pathlib import Path

import pytest

from analysis.bench.rows import SPREAD, Row, limit_row, rate_row
from analysis.bench.tables import better_by, comparison_table, figure, group_tables, rows_table
from analysis.command.console import Table, show

RATE = rate_row(Row("coherent", "camera rays", "M rays/s", 0.0, "Embree"), 30.0, [1.0] * 7, [3.5] * 7, 3.0)
LIMIT = limit_row(Row("growth", "cycle", "exponent", 0.0, "limit", note="16: 2 ms"), [1.2] * 7, 1.05)
FOUND = {
    "machine": {"cpu": "Some CPU", "cores": 2, "memory_gib": 23.5, "load_average": 0.5},
    "versions": {"torch": "2.13.0", "mitsuba": None},
    "rows": [RATE.record(), LIMIT.record()],
}


def text(table: Table, capsys: pytest.CaptureFixture) -> str:
    show(table)
    return capsys.readouterr().out


def write(folder: Path, name: str, *rows: Row) -> Path:
    path = folder / name
    path.write_text(json.dumps({"rows": [row.record() for row in rows]}))
    return path


def test_a_table_names_machine_versions_figures_and_notes(capsys: pytest.CaptureFixture) -> None:
    shown = text(rows_table(FOUND), capsys)
    for part in (
        "Some CPU, 2 cores, 23.5 GiB, load average before 0.50",
        "torch 2.13.0",
        "mitsuba not installed",
        SPREAD,
        "cycle: 16: 2 ms",
    ):
        assert part in " ".join(shown.split())
    line = next(line for line in shown.splitlines() if "camera rays" in line)
    for part in ("M rays/s", "30", "8.571 Embree", "3.5", "3.5 – 3.5", "yes"):
        assert part in line
    assert "NO" in next(line for line in shown.splitlines() if "exponent" in line)


def test_tables_of_a_page_name_group_and_instruction_set() -> None:
    rays, growth = group_tables(FOUND)
    assert (rays.title, growth.title) == ("coherent", "growth") and rays.header[:3] == ("coherent", "unit", "ours")
    assert rays.rows == [("camera rays", "M rays/s", "30", "8.571 Embree", "3.5", "3.5 – 3.5", "3", "yes")]
    limited = group_tables({**FOUND, "isa": "avx2"})
    assert [table.header[0] for table in limited] == ["coherent, avx2", "growth, avx2"]
    assert "limited to avx2" in rows_table({**FOUND, "isa": "avx2"}).title


@pytest.mark.parametrize(("value", "shown"), [(None, ""), (0.12341, "0.1234"), (12345.6, "12,346"), (3.0, "3")])
def test_figures_have_four_digits(value: float | None, shown: str) -> None:
    assert figure(value) == shown


def test_a_comparison_knows_which_way_is_better() -> None:
    faster = rate_row(Row("coherent", "camera rays", "M rays/s", 0.0), 60.0, [1.0] * 7, None)
    assert better_by(RATE.record(), faster.record()) == 2.0
    quicker = limit_row(Row("growth", "cycle", "exponent", 0.0), [0.6] * 7, 1.05)
    assert better_by(LIMIT.record(), quicker.record()) == 2.0
    assert better_by(limit_row(Row("growth", "a", "s", 0.0), [1.0], 1.0).record(), {"ours": -0.1}) is None


def test_two_files_are_compared_row_by_row(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    first = write(tmp_path, "a.json", RATE, LIMIT)
    faster = rate_row(Row("coherent", "camera rays", "M rays/s", 0.0), 45.0, [1.0] * 7, None)
    second = write(tmp_path, "b.json", faster)
    shown = text(comparison_table(first, second), capsys)
    assert "1.5" in next(line for line in shown.splitlines() if "camera rays" in line)
    assert "exponent" not in shown


def test_files_that_cannot_be_compared_are_named(tmp_path: Path) -> None:
    good, other = write(tmp_path, "a.json", RATE), write(tmp_path, "b.json", LIMIT)
    for first, second, part in (
        (good, other, "share no row"),
        (good, tmp_path / "d.json", "d.json"),
    ):
        with pytest.raises(ValueError, match=part):
            comparison_table(first, second)


@pytest.mark.parametrize(
    "text", ["", "[]", '{"rows": 3}', '{"rows": [7]}', '{"rows": [{"group": "coherent", "name": "camera rays"}]}']
)
def test_a_file_without_rows_of_a_benchmark_is_named(text: str, tmp_path: Path) -> None:
    good, bad = write(tmp_path, "a.json", RATE), tmp_path / "c.json"
    bad.write_text(text)
    with pytest.raises(ValueError, match=r"^compare: .*c\.json: .*expected") as caught:
        comparison_table(bad, good)
    assert "\n" not in str(caught.value)


def test_a_figure_that_is_no_number_is_named(tmp_path: Path) -> None:
    good, bad = write(tmp_path, "a.json", RATE), tmp_path / "c.json"
    bad.write_text(json.dumps({"rows": [{**RATE.record(), "ours": "fast"}]}))
    with pytest.raises(ValueError, match=r"rows: 0: ours: expected float . None, got \"fast\""):
        comparison_table(good, bad)
