"""Stimuli of the study: sequences rendered from job files, their manifest, and their differences in JOD."""

from __future__ import annotations

import dataclasses
import hashlib
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from PIL import Image

from analysis.command.cli import InputError
from analysis.command.progress import Bars
from analysis.metrics.display_model import DisplayModel
from analysis.perception.options import STUDY_JOBS, StimuliOptions
from analysis.storage.journal import Journal
from analysis.storage.reference import content_hash
from analysis.storage.source import code_hash
from analysis.storage.store import Store
from analysis.tracer.job_farm import run_job_anywhere
from analysis.tracer.jobs import prepare
from analysis.tracer.options import JobOptions

MANIFEST = "manifest.json"
COLUMNS = ("scene", "point_set", "time_filter", "samples", "folder", "files", "sha256")
"""Entries that the manifest has for every stimulus, among others."""


def render_stimuli(options: StimuliOptions, bars: Bars) -> dict[str, Any]:
    """Renders missing stimuli and writes the manifest.

    Args:
        options: jobs, size and length.
        bars: progress bars.

    Returns:
        The manifest: one row a stimulus, with its folder, number of frames and their hash.
    """
    rows: list[dict[str, Any]] = []
    for job_file in options.jobs or STUDY_JOBS:
        job = JobOptions(
            job=job_file,
            width_px=options.width_px,
            first_frame=options.first_frame,
            frames=options.frames,
            seed=options.seed,
            format=options.format,
            box_share=options.box_share,
            threads=options.threads,
            scheduler=options.scheduler,
            worker_wait_s=options.worker_wait_s,
        )
        work = prepare(job)
        scene = work.settings.name
        folder = options.out / scene
        found = run_job_anywhere(work, dataclasses.replace(job, out=folder), bars)
        for combination, row in zip(work.job.combinations, found, strict=True):
            files = [folder / combination.name / f"frame{number:05d}.{options.format}" for number in work.frames]
            video = {}
            if options.video:
                video = _film(files, work.settings.frame_rate_hz)
            rows.append(
                {
                    **video,
                    "scene": scene,
                    "point_set": combination.point_set,
                    "time_filter": combination.time_filter,
                    "samples": combination.samples,
                    "folder": f"{scene}/{combination.name}",
                    "files": [file.name for file in files],
                    "sha256": hash_of(files),
                    "rendered_now": row["rendered_now"],
                    "nonfinite": row["nonfinite"],
                }
            )
    manifest = {"frame_rate_hz": work.settings.frame_rate_hz, "size_px": list(work.size_px), "stimuli": rows}
    write_manifest(options.out, manifest)
    return manifest


def write_manifest(folder: Path, manifest: dict[str, Any]) -> None:
    """Writes a manifest with its checksum."""
    Store(folder, MANIFEST).write_json(MANIFEST, manifest)


def _film(files: Sequence[Path], rate_hz: float) -> dict[str, str]:
    """Joins frames into a lossless film, unless it is on disk; returns its name and hash."""
    from renderer.film.sequence import write_lossless

    code = code_hash(write_lossless, read_frame)
    store, name = Store(files[0].parent, content_hash((hash_of(files), rate_hz, code))), "stimulus.mkv"
    store.require_own([name])
    found = store.find(name)
    if found is None:
        with store.make(name) as making:
            write_lossless(map(read_frame, files), making.path, rate_hz)
        found = store.find(name)
    assert found is not None
    return {"video": name, "video_sha256": found.sha256}


def hash_of(files: Sequence[Path]) -> str:
    """SHA-256 of the concatenation of files."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a folder of stimuli.

    Raises:
        InputError: there is no manifest, it has changed since it was written, or it cannot be read.
    """
    try:
        found = Store(folder, MANIFEST, say=lambda line: None).read_json(MANIFEST, dict)
        if found is None:
            raise ValueError("it is missing or damaged")
        whole = float(found["frame_rate_hz"]) > 0.0 and len(found["size_px"]) == 2
        for row in found["stimuli"]:
            whole = whole and all(name in row for name in COLUMNS) and row["samples"] > 0
        if not whole:
            raise ValueError("it is incomplete")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"stimuli: expected {folder / MANIFEST}, written by the command 'stimuli' ({error})") from None
    return found


def read_frame(file: Path) -> NDArray[np.uint8]:
    """A frame ``(h, w, 3)`` encoded for display; linear radiance is encoded as sRGB.

    Raises:
        OSError: the file cannot be opened.
        FilmError: an EXR file cannot be read.
    """
    if file.suffix == ".exr":
        import torch

        from renderer.film.files import encode_srgb, read_exr

        return encode_srgb(torch.as_tensor(read_exr(file)))
    return np.asarray(Image.open(file).convert("RGB"))


def png_of(file: Path) -> bytes:
    """A frame as a PNG file."""
    if file.suffix == ".png":
        return file.read_bytes()
    content = io.BytesIO()
    Image.fromarray(read_frame(file)).save(content, format="PNG")
    return content.getvalue()


def frames_of(folder: Path, row: dict[str, Any]) -> NDArray[np.uint8]:
    """Frames ``(count, h, w, 3)`` of a stimulus.

    Raises:
        InputError: one is missing or is not what the manifest says.
    """
    files = check_frames(folder, row)
    try:
        return np.stack([read_frame(file) for file in files])
    except OSError as error:
        raise InputError(f"stimuli: {folder / row['folder']}: cannot be read ({error.strerror or error})") from None


def check_frames(folder: Path, row: dict[str, Any]) -> list[Path]:
    """The files of a stimulus.

    Raises:
        InputError: one is missing or is not what the manifest says.
    """
    files = [folder / row["folder"] / name for name in row["files"]]
    try:
        if hash_of(files) != row["sha256"]:
            raise InputError(f"stimuli: {folder / row['folder']}: expected the frames of the manifest, got others")
    except OSError as error:
        raise InputError(f"stimuli: {error.filename}: cannot be read ({error.strerror})") from None
    return files


def differences(folder: Path, display: DisplayModel, bars: Bars) -> pd.DataFrame:
    """Difference in JOD of every stimulus from that with the most samples of its scene, set and filter.

    Scores are kept in ``jod.journal`` in the folder, by the hashes of both stimuli, the display and the metric.

    Args:
        folder: folder of the stimuli.
        display: display that the scores assume.
        bars: progress bars.
    """
    from analysis.metrics.perceptual import jod

    manifest, code = read_manifest(folder), code_hash(jod)
    journal = Journal(folder / "jod.journal")
    kept = {row["key"]: float(row["jod"]) for row in journal.rows()}
    table = pd.DataFrame(manifest["stimuli"])
    task, rows = bars.task("JOD", len(table)), []
    for _, group in table.groupby(["scene", "point_set", "time_filter"], sort=False):
        ordered = group.sort_values("samples").to_dict("records")
        reference, reference_frames = ordered[-1], None
        for row in ordered:
            key = f"{row['sha256']} {reference['sha256']} {display.name} {display.rate_hz:g} {code}"
            if row is reference:
                kept[key] = 0.0
            elif key not in kept:
                if reference_frames is None:
                    reference_frames = frames_of(folder, reference)
                score = jod(frames_of(folder, row), reference_frames, manifest["frame_rate_hz"], display)
                kept[key] = 10.0 - score
                journal.append({"key": key, "jod": kept[key]})
            rows.append(
                {name: row[name] for name in ("scene", "point_set", "time_filter", "samples")} | {"jod": kept[key]}
            )
            task.advance()
    return pd.DataFrame(rows)
