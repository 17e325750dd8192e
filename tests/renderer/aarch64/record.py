"""Records launches of native code on this processor: the memory that each refers to, before and after.

``python -m tests.renderer.aarch64.record FOLDER`` renders a scene, asks rays, and runs cycles of two policies. A launch
is written as blocks of memory and the places of addresses in them, which another process can replay elsewhere.
"""

from __future__ import annotations

import ctypes
import json
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
import warp as wp
from numpy.typing import NDArray

from renderer.compute import launching

CALL = 6
"""Which call of a kernel is kept; of a kernel with fewer calls the last."""

Blocks = list[tuple[int, bytes]]
"""Addresses and contents of disjoint memory."""
Words = NDArray[np.int64]
"""Words that hold addresses, ``(n, 4)``: block and offset of the word, block and offset that it refers to."""


@dataclass(frozen=True)
class Launch:
    """One launch: which call it was, the memory before, addresses in it, those of its two parameters, the memory
    after."""

    count: int
    before: list[bytes]
    words: Words
    places: list[tuple[int, int]]
    after: bytes


@dataclass
class Recorder:
    """Wraps launches from the moment it is made.

    Attributes:
        launches: by symbol of the compiled kernel.
        sources: generated files of their modules.
    """

    launches: dict[str, Launch] = field(default_factory=dict)
    sources: set[Path] = field(default_factory=set)
    _known: dict[int, tuple[int, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        recorder, make, address = self, launching.Command.__init__, launching.address
        make_record = launching.NativeRecord.__init__

        def command(made: launching.Command, kernel: Any, *fixed: Any, size: int = 1) -> None:
            make(made, kernel, *fixed, size=size)
            for one in fixed:
                recorder.keep_arrays(one)
            launch = made.launch
            made.launch = lambda: recorder.around(kernel, launch)

        def registering(name: str, values: Any, dtype: torch.dtype, count: int) -> int:
            whole = values if isinstance(values, torch.Tensor) else torch.from_numpy(values)
            recorder.keep(whole.untyped_storage().data_ptr(), whole.untyped_storage().nbytes(), values)
            return address(name, values, dtype, count)

        def record(made: launching.NativeRecord, layout: str) -> None:
            make_record(made, layout)
            recorder.keep(made.address, ctypes.sizeof(made._bytes), made)

        launching.Command.__init__, launching.NativeRecord.__init__ = command, record
        launching.address = registering

    def keep(self, address: int, size: int, owner: Any) -> None:
        """Counts memory among that to which launches may refer, and keeps it alive."""
        if size > self._known.get(address, (0, None))[0]:
            self._known[address] = size, owner

    def keep_arrays(self, value: Any) -> None:
        """Does so for an array of Warp, or all in a structure."""
        if isinstance(value, wp.array) and value.ptr:
            self.keep(value.ptr, value.capacity, value)
        for name in getattr(getattr(value, "_cls", None), "vars", ()):
            self.keep_arrays(getattr(value, name))

    def memory(self, *roots: int) -> tuple[Blocks, Words]:
        """The memory that these addresses refer to, and memory that its words refer to; what overlaps is one block."""
        merged: list[list[int]] = []
        for address, (size, _) in sorted(self._known.items()):
            if merged and address <= merged[-1][1]:
                merged[-1][1] = max(merged[-1][1], address + size)
            else:
                merged.append([address, address + size])
        first, ends = np.array(merged, np.uint64).T
        found: dict[int, int] = {}  # number of a block kept among all
        blocks, words = [], []
        due = [_located(root, first, ends)[0] for root in roots]
        while due:
            number = due.pop(0)
            if number in found:
                continue
            found[number] = len(blocks)
            block = ctypes.string_at(int(first[number]), int(ends[number] - first[number]))
            blocks.append((int(first[number]), block))
            word = np.frombuffer(block[: len(block) // 8 * 8], np.uint64)
            for place in np.flatnonzero((word >= first[0]) & (word < ends[-1])):
                to, offset = _located(int(word[place]), first, ends)
                if to >= 0:
                    words.append((found[number], 8 * int(place), to, offset))
                    due.append(to)
        return blocks, np.array([(a, b, found[c], d) for a, b, c, d in words], np.int64).reshape(-1, 4)

    def around(self, kernel: Any, launch: Any) -> None:
        """Runs a launch, and keeps the memory before and after it."""
        symbol = f"{kernel.get_mangled_name()}_cpu_forward"
        count = self.launches[symbol].count + 1 if symbol in self.launches else 1
        if count > CALL:
            launch()
            return
        parts = [one._obj for one in launch.args]  # bounds and arguments
        roots = [ctypes.addressof(part) for part in parts]
        for root, part in zip(roots, parts, strict=True):
            self.keep(root, ctypes.sizeof(part), part)
        blocks, words = self.memory(*roots)
        launch()
        after = b"".join(ctypes.string_at(address, len(block)) for address, block in blocks)
        first = [next(n for n, (at, block) in enumerate(blocks) if at <= root < at + len(block)) for root in roots]
        places = [(number, root - blocks[number][0]) for number, root in zip(first, roots, strict=True)]
        self.launches[symbol] = Launch(count, [block for _, block in blocks], words, places, after)
        identifier = kernel.module.get_module_identifier(block_dim=1)
        self.sources.add(Path(wp.config.kernel_cache_dir or "") / identifier / f"{identifier}.cpp")

    def write(self, folder: Path) -> None:
        """Writes every launch, as ``replay.cpp`` reads it, its memory afterwards, and the list of sources."""
        for symbol, launch in self.launches.items():
            with (folder / f"{symbol}.launch").open("wb") as file:
                sizes = [len(block) for block in launch.before]
                head = [len(sizes), len(launch.words), *sum(launch.places, ()), *sizes]
                file.write(np.array(head, np.int64).tobytes() + launch.words.tobytes() + b"".join(launch.before))
            (folder / f"{symbol}.after").write_bytes(launch.after)
        (folder / "sources.json").write_text(json.dumps(sorted(map(str, self.sources))))


def _located(address: int, first: np.ndarray, ends: np.ndarray) -> tuple[int, int]:
    number = int(np.searchsorted(first, np.uint64(address), side="right")) - 1
    if number < 0 or address >= int(ends[number]):
        return -1, 0
    return number, address - int(first[number])


def main(folder: Path) -> None:
    """Renders, asks and runs, once with each kind of launch."""
    recorder = Recorder()
    # only now: these take the functions that are wrapped
    from renderer.rays import queries
    from renderer.stages.control import compiled_stages
    from renderer.trace import Renderer
    from scenes import catalog
    from scenes.canonical import Mesh
    from tsar.clock import fixed_clock
    from tsar.config import TsarConfig
    from tsar.policies import POLICIES
    from tsar.policy import Setting, run

    launch = wp.launch

    def launched(kernel: Any, dim: int, inputs: Any, record_cmd: bool = False, **more: Any) -> Any:
        if sys._getframe(1).f_globals["__name__"] == launching.__name__:  # a command in the making
            return launch(kernel, dim, inputs=inputs, record_cmd=record_cmd, **more)
        for one in inputs:
            recorder.keep_arrays(one)
        command = launching.Command(kernel, *inputs, size=dim)
        return command if record_cmd else command.launch()

    wp.launch = launched
    scene = catalog.load("fly-by")
    renderer = Renderer(scene, threads=1, footprint_resolution_px=64)
    renderer.render_frame(0.5, 64, 64, 1)
    mesh = max((one.shape for one in scene.instances if isinstance(one.shape, Mesh)), key=lambda mesh: len(mesh.faces))
    _ask(queries, recorder, mesh)
    config = TsarConfig(batch_size=16, resolution_px=64, sdf_side=16, cache_size=64, warmup_cycles=2)
    for name in ("thesis", "tsar"):
        stages = compiled_stages(config)
        setting = Setting(
            config, lambda _, stages=stages: stages, None, renderer.trace, renderer.viewpoint, lambda: True
        )
        for _ in run(POLICIES[name](setting), renderer.trace, fixed_clock(1 / 60), 0.0, 8 / 60):
            pass
    recorder.write(folder)


def _ask(queries: Any, recorder: Recorder, mesh: Any) -> None:
    """Rays towards a mesh, some of them together and some apart."""
    hits = queries.RayHits

    def kept(*parts: np.ndarray) -> Any:
        for part in parts:
            recorder.keep(part.ctypes.data, part.nbytes, part)
        return hits(*parts)

    queries.RayHits = kept
    asked = queries.RayQueries(mesh.vertices, mesh.faces)
    for part in (asked._nodes, asked._blocks):
        recorder.keep(part.ctypes.data, part.nbytes, part)
    draws = np.random.default_rng(0)
    middle, size = mesh.vertices.mean(axis=0), np.ptp(mesh.vertices, axis=0).max()
    origin = middle + size * draws.normal(size=(512, 3))
    origin[:256] = origin[0]
    asked.closest(origin, middle + 0.3 * size * draws.normal(size=(512, 3)) - origin)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
