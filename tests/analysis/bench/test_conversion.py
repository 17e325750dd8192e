"""The benchmark of conversion on small scenes."""

from __future__ import annotations

from pathlib import Path

import pytest

from analysis.bench import conversion as bench_conversion
from analysis.bench.conversion import conversion, relief, write_mesh_scene, write_text_scene
from analysis.bench.options import BenchOptions
from analysis.command.progress import bars
from scenes.formats.conversion import load_scene_file


def test_scenes_are_as_large_as_they_say(tmp_path: Path) -> None:
    for write, path in ((write_text_scene, tmp_path / "a.pbrt"), (write_mesh_scene, tmp_path / "b.pbrt")):
        assert write(path, 1.0) == pytest.approx(1e6, rel=0.3)
        (surface,) = load_scene_file(path).instances
        side = round(len(surface.shape.vertices) ** 0.5)  # type: ignore[union-attr]
        assert len(surface.shape.faces) == 2 * (side - 1) ** 2 == len(relief(side)[1])  # type: ignore[union-attr]


def test_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_conversion, "SIZES_MB", (0.1, 0.2))
    monkeypatch.setattr(bench_conversion, "LARGE_MB", 4)
    with bars() as shown:
        rows = list(conversion(BenchOptions(repetitions=7), shown))
    assert [row.group for row in rows] == ["conversion"] * 4
    assert rows[0].ours > 0.0 and "3 x 3" in rows[0].name and "slowest" in rows[0].note
    assert "MB/s" in rows[1].note
    assert all(row.ours > 0.5 for row in rows[2:])  # at least the mesh itself
