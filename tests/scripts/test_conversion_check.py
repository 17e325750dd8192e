"""The command that renders converted scenes with the renderers they are for."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.scenes.formats.test_conversion import DATA, needs_data
from tests.scripts.commands import assert_refused, call_script, nothing_in


@needs_data
def test_the_box_is_the_same_in_both_renderers(tmp_path: Path, monkeypatch, capsys) -> None:
    """Also the framing: LuxCore from the same file, as it is and read and written again, to the noise."""
    pytest.importorskip("mitsuba")
    pytest.importorskip("pyluxcore")
    file = str(DATA / "luxrender/cornell-box/cornell-box.lxs")
    size = ("--width-px", "32", "--samples", "64", "--out", str(tmp_path))
    assert call_script("conversion_check.py", monkeypatch, file, *size) == 0, capsys.readouterr().err
    other, again = json.loads((tmp_path / "summary.json").read_text())["rows"]
    assert (other["second"], again["second"]) == ("mitsuba", "luxcore") and other["note"] == again["note"] == ""
    assert again["flip"] < 0.06 and again["mean_r"] == pytest.approx(1.0, abs=0.02)
    assert other["mean_r"] == pytest.approx(1.0, abs=0.15)


def test_a_renderer_that_fails_is_a_line(tmp_path: Path) -> None:
    from analysis.conversion_check import rendered

    assert isinstance(rendered("mitsuba", tmp_path / "none.xml", tmp_path / "a.npy", (8, 8), 1, 60.0), str)
    found = rendered("luxcore", tmp_path / "none.lxs", tmp_path / "b.npy", (8, 8), 1, 60.0)
    assert isinstance(found, str) and "\n" not in found


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [(("gone.xml",), ("scenes", "scene files")), (("--width-px", "2", __file__), ("width_px", "between 16 and 4096"))],
)
def test_bad_input(arguments, parts, tmp_path: Path, monkeypatch, capsys) -> None:
    status = call_script("conversion_check.py", monkeypatch, *arguments, "--out", str(tmp_path / "out"))
    assert_refused(status, capsys, parts)
    assert nothing_in(tmp_path / "out")
