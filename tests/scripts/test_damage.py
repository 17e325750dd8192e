"""A flipped bit in any durable file is detected: the result is that of an undamaged run, or the file is refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.durable import KINDS, restore

FLIPS = {
    "reference": 100, "half a reference": 100, "evaluate": 40, "inputs": 6, "run": 4, "render": 40, "job": 40,
    "stimuli": 40, "tiles": 40, "session": 40,
}  # fmt: skip
FEW = {name: 4 for name in FLIPS if name not in ("inputs", "run")}


@pytest.mark.parametrize(
    ("name", "count"),
    [*FEW.items(), *(pytest.param(name, count, marks=pytest.mark.slow) for name, count in FLIPS.items())],
)
def test_a_flipped_bit_changes_no_result(name: str, count: int, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    kind, folder, whole = KINDS[name], tmp_path / "made", tmp_path / "whole"
    folder.mkdir()
    kind.prepare(folder)
    given = shutil.copytree(folder, tmp_path / "given")
    assert kind.make(folder) == 0, capsys.readouterr().err
    expected = kind.result(folder)
    # one that was interrupted is damaged as it was then
    shutil.copytree(given if name.startswith("half") else folder, whole)
    rng, remade, refused = np.random.default_rng(len(name)), 0, 0
    for _ in range(count):
        restore(whole, folder)
        file = rng.choice(np.array(kind.files(folder)))
        content, bit = bytearray(file.read_bytes()), int(rng.integers(8 * file.stat().st_size))
        content[bit // 8] ^= 1 << bit % 8
        file.write_bytes(content)
        capsys.readouterr()
        status, where = kind.make(folder), f"bit {bit} of {file.relative_to(folder)}"
        error = capsys.readouterr().err
        assert status in (0, 2) and "Traceback" not in error, f"{where}: {error}"
        if status == 2:
            refused += 1
            assert error.splitlines()[-1].startswith("error: ") and str(file.parent) in error, f"{where}: {error}"
        else:
            remade += 1
            found = kind.result(folder)
            differing = [one for one in expected if found.get(one) != expected[one]]
            assert found.keys() == expected.keys() and not differing, f"{where}: silently different: {differing}"
    with capsys.disabled():
        print(f"\n{name}: {count} flips, {remade} as unbroken, {refused} refused by name, 0 silently different")
