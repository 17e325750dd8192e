"""Other renderers: several pictures of one start."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from analysis.conversion.peers import drawn, rendered
from analysis.conversion.specimens import lamp
from scenes.formats.conversion import save_scene_file


@pytest.mark.parametrize(
    ("program", "module", "to", "ending"),
    [("mitsuba", "mitsuba", "mitsuba3", ".xml"), ("luxcore", "pyluxcore", "luxrender", ".lxs")],
)
def test_pictures_of_one_start_are_those_of_single_ones(
    program: str, module: str, to: str, ending: str, tmp_path: Path
) -> None:
    pytest.importorskip(module)
    files = [(tmp_path / f"{name}{ending}", tmp_path / f"{name}.npy") for name in ("broken", "point", "sphere")]
    files[0][0].write_text("Nonsense")
    for (file, _), name in zip(files[1:], ("point", "lamp, sphere"), strict=True):
        save_scene_file(lamp(name).scene, file, to)
    found = drawn(program, files, (24, 24), 64, 100.0)
    assert set(found) == {out for _, out in files[1:]}
    for file, out in files[1:]:
        single = rendered(program, file, tmp_path / "single.npy", (24, 24), 64, 100.0)
        assert not isinstance(single, str), single
        np.testing.assert_allclose(found[out].mean(axis=(0, 1)), single.mean(axis=(0, 1)), rtol=0.03)
