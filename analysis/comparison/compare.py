"""A comparison from Python: the same as ``tsar run``, with policies, metrics and scenes as objects or by name."""

from __future__ import annotations

import dataclasses
import difflib
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from analysis.command.ownership import release_folder
from analysis.comparison.experiment import measure
from analysis.comparison.options import DEFAULT_POLICY, RunOptions
from analysis.metrics import METRICS, Metric
from analysis.metrics.quality import DisplayedImages, reference_times
from tsar.config import ConfigError, TsarConfig
from tsar.policies import POLICIES

if TYPE_CHECKING:
    from torch import Tensor

    from analysis.comparison.summary import Measured
    from scenes.canonical import Scene
    from tsar.policies import Make

REFERENCE = "reference"
"""Name of the reference among the images of a result."""
_IMAGES = 5


@dataclass(frozen=True)
class Result:
    """A finished comparison.

    Attributes:
        folder: folder of its files; removed with this object unless ``out`` was given.
        summary: the content of ``summary.json``.
        errors: ``mse``, ``log_mse`` and image metrics over ``run`` and ``time_s``; NaN where a metric was not taken.
        images: linear RGB over ``run``, ``time_s``, ``row``, ``column`` and ``channel``: the image on each display,
            and the reference.
    """

    folder: Path
    summary: Mapping[str, Any] = field(repr=False)
    errors: xr.Dataset = field(repr=False)
    images: xr.DataArray = field(repr=False)
    _temporary: Any = field(repr=False)

    def table(self) -> pd.DataFrame:
        """One row a run: median errors, the ratio of the first policy's error to this one's (its median, its quartiles
        and the share of the times at which it is at most 1), images shown, and the mean of each metric."""
        shown = self.summary
        rows = self.errors[["mse", "log_mse"]].median("time_s").to_dataframe()
        ratios = shown.get("ratio_statistics", {})
        for name, of in {
            "ratio": lambda one: one.median,
            "ratio_low": lambda one: one.quartile_low,
            "ratio_high": lambda one: one.quartile_high,
            "share_suitable": lambda one: one.share_suitable,
        }.items():
            rows[name] = pd.Series({run: of(statistics) for run, statistics in ratios.items()}, dtype=float)
        rows["images"] = pd.Series(shown["images"])
        for metric, values in shown["metrics"].items():
            rows[metric] = pd.Series(values)
        return rows

    def report(self, path: str | PathLike[str]) -> Path:
        """Writes the report, one HTML file that needs no network, and returns its path."""
        target = Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(self.folder / "report.html", target)
        return target


def compare(
    scene: str | PathLike[str] | Scene,
    policies: Sequence[str | Make] = (DEFAULT_POLICY, "framed", "thesis"),
    metrics: Sequence[str | Callable[[Tensor, Tensor], float]] = (),
    seconds: float = 2.0,
    *,
    image_times_s: Sequence[float] | None = None,
    out: str | PathLike[str] | None = None,
    references: str | PathLike[str] | None = None,
    **more: Any,
) -> Result:
    """Compares policies on a scene at equal cost.

    Args:
        scene: a scene, the name of a built-in one or of one that was added, or a scene file.
        policies: names, or classes of policies, which go by their own name; ratios are of the first to each of the
            others.
        metrics: names, or functions of two display-encoded images ``(h, w, 3)`` in [0, 1], shown and reference, which
            go by their own name; lower is better. ``jod`` scores the middle of the run (``jod_s``).
        seconds: animation time to measure, seconds.
        image_times_s: times at which images are kept, each at the last reference time that is not later; by default
            five, evenly spaced.
        out: folder for all files of ``tsar run``; by default one that is removed with the result.
        references: folder for references, which several comparisons may share; by default that name within ``out``.
        more: further options of a run (:class:`analysis.comparison.options.RunOptions`), and fields of
            :class:`tsar.config.TsarConfig`, such as ``resolution_px``, ``batch_size`` or ``response``.

    Returns:
        The result. The same arguments give the same result.

    Raises:
        ValueError: an option is unknown or out of range; the message names it.
    """
    temporary = None if out is not None else tempfile.TemporaryDirectory(prefix="tsar-")
    folder = Path(fspath(out)) if out is not None else Path(temporary.name)  # type: ignore[union-attr]
    named, makers = _named(policies, lambda maker: maker)
    measured, functions = _named(metrics, lambda function: Metric("lower", image=function))
    given = None if isinstance(scene, str | PathLike) else scene
    label = fspath(scene) if isinstance(scene, str | PathLike) else scene.name or "scene"
    if not named:
        raise ConfigError("policies: expected at least one, got none")
    with POLICIES.lent(**makers), METRICS.lent(**functions):
        shared = folder / "references" if references is None else Path(fspath(references))
        usual = {"film": False, "references": shared, "metric_stride": 1}
        chosen = {"policy": named[0], "rivals": named[1:], "metrics": measured, "seconds": seconds, "out": folder}
        options = _options({"input": label, **usual, **chosen}, more)
        kept = _Kept(_numbers(options, image_times_s))
        try:
            summary, found = measure(options, scene=given, viewers=(kept,))
        finally:
            release_folder(folder)
    return Result(folder, summary, _errors(found), kept.images(list(found.seen)), temporary)


def _named(given: Sequence[Any], made: Callable[[Any], Any]) -> tuple[tuple[str, ...], dict[str, Any]]:
    """The names of all that was given, and new table entries for objects that are in no table yet."""
    entries = {one.__name__: made(one) for one in given if not isinstance(one, str)}
    return tuple(one if isinstance(one, str) else one.__name__ for one in given), entries


def _options(known: Mapping[str, Any], more: Mapping[str, Any]) -> RunOptions:
    pipeline, run = ([one.name for one in dataclasses.fields(record)] for record in (TsarConfig, RunOptions))
    for name in more:
        if name not in (*pipeline, *run):
            near = difflib.get_close_matches(name, [*pipeline, *run], n=1)
            raise ConfigError(f"{name}: expected an option of a run{f', such as {near[0]}' if near else ''}")
    config = dataclasses.replace(
        more.get("tsar", TsarConfig()), **{name: value for name, value in more.items() if name in pipeline}
    )
    return RunOptions(**{**known, **{name: value for name, value in more.items() if name in run}, "tsar": config})


def _numbers(options: RunOptions, wanted_s: Sequence[float] | None) -> list[int]:
    """Indices of the reference times whose images are kept."""
    times_s = reference_times(options.start_s, options.start_s + options.seconds, options.reference_rate_hz)
    if wanted_s is None:
        return sorted({round(number) for number in np.linspace(0, len(times_s) - 1, _IMAGES)})
    early = [time_s for time_s in wanted_s if time_s < times_s[0]]
    if early:
        raise ConfigError(f"image_times_s: expected times from {times_s[0]:g} s, got {early[0]:g}")
    return sorted({int(np.searchsorted(times_s, time_s + 1e-9, side="right")) - 1 for time_s in wanted_s})


class _Kept:
    """Keeps the images on all displays at some reference times. Changes in place."""

    def __init__(self, numbers: Sequence[int]) -> None:
        self._numbers = set(numbers)
        self._times_s: list[float] = []
        self._images: list[list[np.ndarray]] = []

    def __call__(self, view: DisplayedImages) -> None:
        if view.number in self._numbers:
            self._times_s.append(view.time_s)
            shown = [display.image for _, display in view.shown.values()]
            self._images.append([image.numpy().copy() for image in (*shown, view.reference)])

    def images(self, runs: list[str]) -> xr.DataArray:
        """All kept images, labelled."""
        values = np.stack([np.stack(images) for images in self._images], axis=1)
        names = {"run": [*runs, REFERENCE], "time_s": self._times_s, "channel": ["red", "green", "blue"]}
        return xr.DataArray(values, names, ("run", "time_s", "row", "column", "channel"), "radiance")


def _errors(measured: Measured) -> xr.Dataset:
    names = dict.fromkeys(name for seen in measured.seen.values() for row in seen.rows for name in row)
    variables = {
        name: (("run", "time_s"), np.stack([seen.column(name) for seen in measured.seen.values()]))
        for name in names
        if name not in ("time_s", "refresh")
    }
    return xr.Dataset(variables, {"run": list(measured.seen), "time_s": measured.times_s})
