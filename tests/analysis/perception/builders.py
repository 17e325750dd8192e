"""Small stimuli on disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from analysis.perception.stimuli import hash_of, write_manifest

LEVELS = (1, 8, 64)


def write_stimuli(folder: Path, side: int = 24, frames: int = 3, scenes: tuple[str, ...] = ("planescene",)) -> Path:
    """Noise that falls with the level, in one set and filter, and its manifest."""
    rows = []
    for number, scene in enumerate(scenes):
        for level in LEVELS:
            rng = np.random.default_rng([number, level])
            name = f"{scene}/hammersley-box-{level:04d}"
            (folder / name).mkdir(parents=True)
            files = [folder / name / f"frame{frame:05d}.png" for frame in range(frames)]
            for file in files:
                noise = rng.normal(0.0, 60.0 / level**0.5, (side, side, 3))
                Image.fromarray(np.clip(128.0 + noise, 0, 255).astype(np.uint8)).save(file)
            rows.append(
                {
                    "scene": scene,
                    "point_set": "hammersley",
                    "time_filter": "box",
                    "samples": level,
                    "folder": name,
                    "files": [file.name for file in files],
                    "sha256": hash_of(files),
                }
            )
    write_manifest(folder, {"frame_rate_hz": 30.0, "size_px": [side, side], "stimuli": rows})
    return folder
