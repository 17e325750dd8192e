"""Other renderers: several pictures of one start."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from analysis.conversion import peers
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
    found = drawn(program, files, (24, 24), 1024, 100.0)
    assert set(found) == {out for _, out in files[1:]}
    for file, out in files[1:]:
        single = rendered(program, file, tmp_path / "single.npy", (24, 24), 1024, 100.0)
        assert not isinstance(single, str), single
        np.testing.assert_allclose(found[out].mean(axis=(0, 1)), single.mean(axis=(0, 1)), rtol=0.03)


def test_a_picture_that_takes_too_long_ends_and_leaves_the_others_their_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = """
import os, sys, time, numpy
open(sys.argv[2] + ".pid", "w").write(str(os.getpid()))
time.sleep(600 if "slow" in sys.argv[1] else 0)
numpy.save(sys.argv[2], numpy.ones((1, 1, 3)))
"""
    monkeypatch.setitem(peers._PROGRAMS, "waits", program)
    monkeypatch.setitem(peers._MODULES, "waits", "json")
    files = [(tmp_path / name, tmp_path / f"{name}.npy") for name in ("slow", "quick")]
    assert set(drawn("waits", files, (1, 1), 1, 2.0)) == {files[1][1]}
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "slow.npy.pid").read_text()), 0)
