"""Runs one case of a study and writes its result to disk.

A result is a table over the reference times (Parquet), stills, and the measurements of the whole run (JSON), which are
written last. The case is done if all of these files are intact. Nothing in them depends on the number of
threads, processes or machines, except the entry ``machine`` of the JSON file: measured seconds and memory.
"""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import torch
from PIL import Image

from analysis.command.awaited import OTHER_SOURCE
from analysis.metrics.causes import Truths
from analysis.metrics.perceptual import jod
from analysis.metrics.quality import DisplayedImages, reference_times
from analysis.page.pictures import PagePixels, tiling_map
from analysis.page.video import to_pixels
from analysis.storage.files import locked
from analysis.storage.reference import Reference, as_stored
from analysis.storage.source import code_hash
from analysis.storage.store import Store
from analysis.study.budget import Budgeting, averaged
from analysis.study.cases import Case
from analysis.study.displays import DisplayRecord, Measuring, enlarged, watch
from analysis.study.memory import PeakMemory
from analysis.study.runs import Machine, PolicyRun, Totals, begin
from analysis.study.scenery import render_reference, renderer
from analysis.study.spending import spent
from tsar.threads import one_thread

if TYPE_CHECKING:
    from renderer.posed import PosedRenderer
    from renderer.trace import Renderer


@dataclass(frozen=True)
class Resources:
    """Folders of results and references, and the number of threads.

    Attributes:
        results: folder of results, one for all studies of a kind.
        references: folder of references, shared with all other runs.
        threads: threads for tracing and reconstruction; everything else runs on one.
    """

    results: Path
    references: Path
    threads: int = 1

    def files(self, key: str) -> dict[str, Path]:
        """Files of a result."""
        return {"summary": self.results / f"{key}.json", "times": self.results / f"{key}.parquet"}

    def still(self, key: str, what: str, number: int) -> Path:
        """Picture number ``number`` of ``what``: shown, reference, or tiling."""
        return self.results / "stills" / f"{key}-{number}-{what}.png"

    def store(self, key: str) -> Store:
        """The store that checks the files of a result."""
        return _store(self.results).under(key)


@lru_cache(maxsize=4)
def _store(results: Path) -> Store:
    return Store(results, "")


@lru_cache(maxsize=1)
def source_of_results() -> str:
    """Hash of the source, assets and libraries that decide a result.

    It is taken once in a process, because the process keeps the modules that it has imported: a worker that was started
    before a change must not report results under the new hash.
    """
    return code_hash(evaluate)


def finished(key: str, place: Resources) -> dict[str, Any] | None:
    """The summary of a result whose files are all intact on disk, or None. Reports damaged files.

    Raises:
        ValueError: the file is not the summary of a result.
    """
    store, files = place.store(key), place.files(key)
    found = store.read_json(files["summary"].name, {"key": str, "case": dict, "stills": list[str]})
    names = [files["times"].name, *found["stills"]] if found else []
    return found if names and all(store.find(name) is not None for name in names) else None


def times_of(key: str, place: Resources) -> pd.DataFrame:
    """The table of a finished result over the reference times.

    Raises:
        ValueError: the table is not intact on disk.
    """
    file = place.files(key)["times"]
    content = place.store(key).read(file.name)
    if content is None:
        raise ValueError(f"{file}: expected the table of a finished run, found none or another")
    return pd.read_parquet(io.BytesIO(content))


def broken(found: Iterable[Mapping[str, Any] | None]) -> list[str]:
    """Names of those results whose cycles broke an invariant, from their summaries; only adaptive runs have
    invariants."""
    return [one["key"] for one in found if one and not one.get("invariants", {"ok": True})["ok"]]


def evaluate(case: Case, key: str, place: Resources) -> str:
    """Runs a case unless its result is on disk; of two processes that want it, only one runs it.

    Args:
        case: the case.
        key: the name of its result, which includes the hash of the source that is meant to make it.
        place: destination of the result.

    Returns:
        The key.

    Raises:
        ValueError: this process runs another source than the process that asked.
    """
    if key != case.key(source_of_results()):
        raise ValueError(OTHER_SOURCE)
    (place.results / "stills").mkdir(parents=True, exist_ok=True)
    if finished(key, place) is not None:
        return key
    with locked(place.results / f"{key}.lock"), one_thread():
        if finished(key, place) is None:
            _run(case, key, place)
    (place.results / f"{key}.lock").unlink(missing_ok=True)
    return key


def _truths(case: Case, reference: Reference) -> Truths:
    """Reference images averaged down to the resolution of the case's display."""

    def image(number: int) -> torch.Tensor:
        return averaged(torch.from_numpy(reference.images[number].astype(np.float32)), case.shown_px)

    return Truths(image, case.start_s, case.scale.reference_rate_hz, reference.spec.count)


def _run(case: Case, key: str, place: Resources) -> None:
    began = time.perf_counter()
    reference = render_reference(case.animation, case.start_s, case.scale, place.references, place.threads)
    truths = _truths(case, reference)
    began_run = time.perf_counter()
    store, stills = place.store(key), list[str]()

    def keep(number: int, pictures: dict[str, PagePixels]) -> None:
        for what, pixels in pictures.items():
            stills.append(place.still(key, what, number).relative_to(place.results).as_posix())
            with store.make(stills[-1]) as made:
                Image.fromarray(pixels).save(made.path)

    scale, config = case.scale, case.tsar
    times_s = reference_times(case.start_s, case.start_s + scale.seconds, scale.reference_rate_hz)
    made = _begin(case, place, truths)
    measuring = Measuring(
        metrics=("ssim", "flip"),
        stride=scale.stride,
        causes=not case.display_px,
        framelet_side=config.framelet_side,
        kept=_scored(case),
    )
    stills_of = _Stills(case, len(times_s), keep)
    dividing = [_budgeting(case, place)] if case.budget_s is not None else []
    shown = enlarged(made.images, case.shown_px)
    with PeakMemory() as peak:
        seen = watch({case.policy: shown}, truths, times_s, measuring, [stills_of, *dividing])[case.policy]
    table, totals = pd.DataFrame(seen.rows), made.totals
    for one in dividing:
        table = table.join(pd.DataFrame(one.rows).add_prefix("budget_"))
    with store.make(place.files(key)["times"].name) as file:
        table.to_parquet(file.path)
    scored = time.perf_counter()
    found = {
        "key": key,
        "case": case,
        "images": seen.images,
        "nonfinite": seen.nonfinite,
        "nonfinite_samples": made.nonfinite_samples,
        "reference_nonfinite": reference.nonfinite,
        "jod": _score(case, seen),
        "regions": seen.regions(),
        "stills": stills,
        **(_cycles(totals, case) if totals.recorded and totals.cycles else {}),
        **({"asked": made.meter.asked} if made.meter.asked is not None else {}),
        "spent": spent(made, case),
        "machine": {
            "reference_s": began_run - began,
            "run_s": scored - began_run,
            "jod_s": time.perf_counter() - scored,
            "threads": place.threads,
            "cycles_s": made.totals.seconds_of(case.scale.seconds),
            "peak_memory_bytes": peak.bytes,
            "run_memory_bytes": peak.grown,
        },
    }
    store.write_json(place.files(key)["summary"].name, found)


def _cycles(totals: Totals, case: Case) -> dict[str, Any]:
    return {
        "cycles": totals.cycles,
        "cycle_s": totals.simulated_s / totals.cycles,
        "age_spread_s": totals.age_spread_s / totals.cycles,
        "overdraw": totals.counters["framelet_pixels"] / totals.cycles / case.tsar.resolution_px**2,
        "saturation": totals.saturation,
        "invariants": totals.invariants,
    }


def _scored(case: Case) -> tuple[int, int]:
    """Indices of the first and the end of the reference times that a metric of sequences scores."""
    low, high = (round(at * case.scale.reference_rate_hz) for at in case.jod_span_s or (0.0, 0.0))
    return low, high


class _Stills:
    """Passes on the pictures of some times, with the number of the still."""

    def __init__(self, case: Case, count: int, keep: Callable[[int, dict[str, PagePixels]], None]) -> None:
        rate_hz = case.scale.reference_rate_hz
        self._case, self._keep = case, keep
        self._numbers = {min(round(at * rate_hz), count - 1): number for number, at in enumerate(case.stills_s)}

    def __call__(self, view: DisplayedImages) -> None:
        if view.number in self._numbers:
            record, display = view.shown[self._case.policy]
            pictures = {"shown": to_pixels(display.image), "reference": to_pixels(view.reference)}
            if record is not None:
                config = self._case.tsar
                side, bounds = max(256, config.resolution_px), config.temporal_bounds
                pictures["tiling"] = tiling_map(record.tiling, record.densities.temporal, side, bounds).pixels()
            self._keep(self._numbers[view.number], pictures)


def _score(case: Case, seen: DisplayRecord) -> float | None:
    if case.jod_span_s is None:
        return None
    shown, reference = (np.stack(frames) for frames in seen.frames)
    return jod(shown, reference, case.scale.reference_rate_hz, case.display)


def _begin(case: Case, place: Resources, truths: Truths) -> PolicyRun:
    def renderer_of(footprint: float) -> Renderer | PosedRenderer:
        return renderer(case.animation, case.tsar.resolution_px * footprint, place.threads, case.tracing)

    machine = Machine(case.ledger, case.capacity, case.cost, case.samples_per_s)
    span_s = case.start_s, case.start_s + case.scale.seconds
    return begin(
        case.policy, case.tsar, renderer_of, machine, span_s, truths.at, threads=place.threads, parts=dict(case.parts),
        formats=dict(case.formats),
    )  # fmt: skip


def _budgeting(case: Case, place: Resources) -> Budgeting:
    scale, side = case.scale, case.tsar.resolution_px
    fine = renderer(case.animation, scale.reference_px, place.threads)

    def picture(time_s: float) -> torch.Tensor:
        found = fine.render_frame(time_s, scale.reference_px, scale.reference_px, scale.reference_samples_per_axis)
        return averaged(torch.from_numpy(as_stored(found).astype(np.float32)), side)

    assert case.budget_s is not None
    return Budgeting(case.policy, side, fine.trace, fine.viewpoint, picture, case.budget_s)
