"""Converted scenes rendered by the renderers that they were converted for, side by side.

Each renderer runs in a process of its own: both bring libraries that do not go together, and a scene that one cannot
load may end it.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from numpy.typing import NDArray

from tsar.config import require

_MITSUBA = """
import sys, numpy as np, mitsuba as mi
file, out, width, height, samples = sys.argv[1], sys.argv[2], *map(int, sys.argv[3:])
mi.set_variant("scalar_rgb")
scene = mi.load_file(file)
parameters = mi.traverse(scene)
(size,) = [key for key in parameters.keys() if key.endswith("film.size")]
parameters[size] = [width, height]
parameters.update()
np.save(out, np.array(mi.render(scene, spp=samples))[..., :3])
"""

_LUXCORE = """
import os, sys, time, numpy as np
import pyluxcore as lux  # after NumPy: its allocator stops a later import
file, out, width, height, samples = sys.argv[1], os.path.abspath(sys.argv[2]), *map(int, sys.argv[3:])
lux.Init()
os.chdir(os.path.dirname(os.path.abspath(file)))
how, what = lux.Properties(), lux.Properties()
lux.ParseLXS(os.path.basename(file), how, what)
for name in list(how.GetAllNames()):
    if name.startswith("film.imagepipeline"):
        how.Delete(name)
for name, value in {"renderengine.type": "PATHCPU", "sampler.type": "SOBOL", "batch.haltspp": samples,
                    "film.width": width, "film.height": height}.items():
    how.Set(lux.Property(name, value))
scene = lux.Scene()
scene.Parse(what)
session = lux.RenderSession(lux.RenderConfig(how, scene))
session.Start()
while not session.HasDone():
    time.sleep(0.1)
    session.UpdateStats()
session.Stop()
pixels = np.zeros((height, width, 3), np.float32)
session.GetFilm().GetOutputFloat(lux.FilmOutputType.RGB, pixels, 0)
np.save(out, pixels[::-1])
sys.stdout.flush()
os._exit(0)
"""

_PROGRAMS = {"mitsuba": _MITSUBA, "luxcore": _LUXCORE}


@dataclass(frozen=True)
class CheckOptions:
    """Renders scene files as converted for Mitsuba 3 and for LuxCore, and compares the pictures."""

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Scene files; those of LuxRender are also rendered as they are."""
    width_px: int = 160
    """Width, pixels; the height follows the film."""
    samples: int = 128
    """Samples per pixel."""
    root: Path | None = None
    """Folder that scenes may read from; by default their own."""
    limit_s: float = 240.0
    """Seconds for each picture at most."""
    out: Path = Path("out/conversion-check")
    """Folder for the scenes, pictures, table.csv and summary.json."""

    def __post_init__(self) -> None:
        require(16 <= self.width_px <= 4096, "width_px", "between 16 and 4096", self.width_px)
        require(1 <= self.samples <= 1 << 16, "samples", "between 1 and 65536", self.samples)
        require(0.0 < self.limit_s <= 86400.0, "limit_s", "between 0 and 86400", self.limit_s)
        for scene in self.scenes:
            require(scene.is_file(), "scenes", "scene files", scene)


def rendered(program: str, file: Path, out: Path, size: tuple[int, int], samples: int, limit_s: float) -> Any:
    """The picture ``(h, w, 3)`` of a renderer, or a line that says why there is none."""
    command = [sys.executable, "-c", _PROGRAMS[program], str(file), str(out), *map(str, size), str(samples)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit_s, check=False)
    except subprocess.TimeoutExpired:
        return f"no picture within {limit_s:g} s"
    if not out.is_file():
        lines = (done.stderr or done.stdout).strip().splitlines() or [f"exit code {done.returncode}"]
        return lines[-1].strip()[:160]
    return np.load(out)


def flip(first: NDArray[np.float32], second: NDArray[np.float32]) -> float:
    """Mean FLIP of two pictures, as shown on a display."""
    import flip_evaluator
    import torch

    from renderer.film import encode_srgb

    encoded = [encode_srgb(torch.as_tensor(np.ascontiguousarray(one))) for one in (first, second)]
    shown = [one.astype(np.float32) / 255.0 for one in encoded]
    return float(flip_evaluator.evaluate(shown[0], shown[1], "LDR")[1])


def checked(options: CheckOptions, tick: Callable[[], None]) -> list[dict[str, Any]]:
    """A row a pair of pictures of each scene."""
    from scenes.formats.conversion import load_scene_file, save_scene_file
    from scenes.formats.losses import LossReport

    rows = []
    for number, source in enumerate(options.scenes):
        scene = load_scene_file(source, options.root)
        folder = options.out / f"{number:02d}-{source.parent.name}-{source.stem}"
        size = options.width_px, max(1, round(options.width_px * scene.film.height_px / scene.film.width_px))
        files = {"mitsuba": folder / "mitsuba3.xml", "luxcore": folder / "luxrender.lxs"}
        lost = LossReport()
        save_scene_file(scene, files["mitsuba"], "mitsuba3", LossReport())
        save_scene_file(scene, files["luxcore"], "luxrender", lost)
        jobs = [(name, name, file) for name, file in files.items()]
        if source.suffix == ".lxs":
            jobs.append(("luxcore, as it is", "luxcore", source))
        pictures = {}
        for name, program, file in jobs:
            out = folder / f"{name.replace(', ', '-').replace(' ', '-')}.npy"
            out.unlink(missing_ok=True)
            pictures[name] = rendered(program, file, out, size, options.samples, options.limit_s)
        first = "luxcore, as it is" if source.suffix == ".lxs" else "mitsuba"
        for other in pictures:
            if other != first:
                rows.append(_row(f"{source.parent.name}/{source.name}", first, other, pictures, len(lost.losses)))
        tick()
    return rows


def _row(scene: str, first: str, other: str, pictures: dict[str, Any], losses: int) -> dict[str, Any]:
    row: dict[str, Any] = {"scene": scene, "first": first, "second": other, "losses": losses}
    for name in (first, other):
        if isinstance(pictures[name], str):
            return {**row, "note": f"{name}: {pictures[name]}"}
    a, b = pictures[first], pictures[other]
    means = a.mean(axis=(0, 1)), b.mean(axis=(0, 1))
    ratio = means[1] / np.maximum(means[0], 1e-9)
    for name, value in zip("rgb", ratio, strict=True):
        row[f"mean_{name}"] = float(value)
    return {**row, "flip": flip(a, b), "note": ""}
