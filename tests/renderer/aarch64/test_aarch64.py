"""Native code has the same results on aarch64, with NEON, as on this processor: launches recorded here run there.

Every kernel with C++ of its own is compiled from the file that Warp generated and run by an emulator, on the memory
that it had here. Warp's compiler fuses no multiplication with an addition unless asked to, so neither does this one.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import warp as wp

ROOT = Path(__file__).resolve().parents[3]
LIBRARY = Path("/usr/aarch64-linux-gnu")
COMPILERS = ["clang++", *(f"clang++-{version}" for version in range(29, 18, -1))]
OPTIONS = "--target=aarch64-linux-gnu -O2 -std=c++17 -ffp-contract=off".split()
NEEDED = "aarch64: needs clang 19, an emulator and libraries: apt-get install clang-19 g++-aarch64-linux-gnu qemu-user"
TICKS = "decide_next", 32
"""The kernel that reads a clock, and the size of the block of its ticks, bytes."""
KERNELS = {
    *("build_tree", "trace_queries", "render_pixels", "shade_samples", "pose_tracks"),
    *("claim_slots", "observe_batch", "decide_next", "take_account"),
    *("find_candidates", "paint_bands", "bury_dead"),
    *("offer", "choose", "take", "locate", "gather", "learn", "take_in", "drifted"),
    *("gain", "best", "shrink", "smooth", "show", "detailed"),
}


def compiler() -> str:
    """A compiler that knows the headers' vector types, or an empty string."""
    for name in COMPILERS:
        if shutil.which(name):
            told = subprocess.run([name, "--version"], capture_output=True, text=True, check=False).stdout
            version = re.search(r"version (\d+)", told)
            if version and int(version[1]) >= 19:
                return name
    return ""


def build(folder: Path, symbols: list[str]) -> None:
    """Compiles the generated files of all modules, and the program that replays their launches."""
    declared = "".join(f'extern "C" void {symbol}(void*, void*);\n' for symbol in symbols)
    listed = ", ".join(f'{{"{symbol}", {symbol}}}' for symbol in symbols)
    table = f"static const struct {{ const char* name; Kernel run; }} KERNELS[] = {{{listed}}};\n"
    (folder / "table.h").write_text(f"typedef void (*Kernel)(void*, void*);\n{declared}{table}")
    command = [compiler(), *OPTIONS, "-I", str(folder), "-I", str(Path(wp.__file__).parent / "native")]
    files = [*json.loads((folder / "sources.json").read_text()), str(Path(__file__).parent / "replay.cpp")]
    objects = [str(folder / f"{Path(file).stem}.o") for file in files]

    def one(file: str, made: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([*command, "-c", file, "-o", made], capture_output=True, text=True, check=False)

    with ThreadPoolExecutor(2) as pool:
        for done in pool.map(one, files, objects):
            assert done.returncode == 0 and done.stderr == "", done.stderr[-2000:]
    # modules repeat functions of the structures that they share
    subprocess.run([*command, "-Wl,--allow-multiple-definition", *objects, "-o", str(folder / "replay")], check=True)


def blocks(folder: Path, symbol: str) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Memory of a launch: before it, after it here and after it there, block by block, without addresses."""
    raw = np.fromfile(folder / f"{symbol}.launch", np.uint8)
    count, addresses = raw[:16].view(np.int64)
    sizes = raw[48 : 48 + 8 * count].view(np.int64)
    words = raw[48 + 8 * count :][: 32 * addresses].view(np.int64).reshape(-1, 4)
    memory = [raw[48 + 8 * count + 32 * addresses :].copy()]
    memory += [np.fromfile(folder / f"{symbol}.{ending}", np.uint8) for ending in ("after", "replayed")]
    ends = np.cumsum(sizes)
    for block, offset, *_ in words:
        first = ends[block] - sizes[block] + offset
        for values in memory:
            values[first : first + 8] = 0
    yield from zip(*(np.split(values, ends[:-1]) for values in memory), strict=True)


def same(here: np.ndarray, there: np.ndarray) -> bool:
    """Whether two blocks have the same bits, but for the signs of what is not a number."""
    if np.array_equal(here, there):
        return True
    whole = len(here) // 4 * 4
    a, b = here[:whole].view(np.float32), there[:whole].view(np.float32)
    other = a.view(np.int32) != b.view(np.int32)
    return np.array_equal(here[whole:], there[whole:]) and bool((np.isnan(a[other]) & np.isnan(b[other])).all())


@pytest.mark.slow
@pytest.mark.skipif(
    not (compiler() and shutil.which("qemu-aarch64") and (LIBRARY / "include" / "c++").is_dir()), reason=NEEDED
)
def test_launches_have_the_same_bits_on_aarch64(tmp_path: Path) -> None:
    record = [sys.executable, "-m", "tests.renderer.aarch64.record", str(tmp_path)]
    subprocess.run(record, cwd=ROOT, check=True)
    symbols = sorted(path.stem for path in tmp_path.glob("*.launch"))
    assert {re.sub(r"_[0-9a-f]{8}_cpu_forward$", "", symbol) for symbol in symbols} == KERNELS
    build(tmp_path, symbols)
    subprocess.run(["qemu-aarch64", "-L", str(LIBRARY), str(tmp_path / "replay"), str(tmp_path)], check=True)
    for symbol in symbols:
        changed = 0
        for before, here, there in blocks(tmp_path, symbol):
            changed += np.count_nonzero(before != here)
            ticks = symbol.startswith(TICKS[0]) and len(here) == TICKS[1]
            assert ticks or same(here, there), symbol
        assert changed, symbol
