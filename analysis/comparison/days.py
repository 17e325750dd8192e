"""Finished runs, also of different days and versions, on one page: their differences, and their pictures.

Pictures and curves are read back from the pages that the runs wrote.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from analysis.command.console import Table
from analysis.comparison.finished import named_folders, read_summary
from analysis.page.comparer import Comparer, Panel, Step, read_comparer
from analysis.page.curves import Curve, Plot
from analysis.page.report import Report, flat
from analysis.storage.results import SUMMARY

_SAME_S = 1e-6  # closer times count as one
_UNTOLD = ("out", "references", "cache", "content", "config_hash")


@dataclass(frozen=True)
class FinishedRun:
    """A finished run as read from its folder.

    Attributes:
        name: its unique name on the page.
        summary: the content of ``summary.json``.
        comparer: the content of its page; None if that cannot be read.
        lack: why the page cannot be read; empty if it can.
        made: date and time at which its summary was written.
    """

    name: str
    summary: Mapping[str, Any]
    comparer: Comparer | None
    lack: str = ""
    made: str = ""

    @property
    def own(self) -> str:
        """Name of the run's policy."""
        return self.summary["policy"]

    def median(self, run: str) -> float:
        """Median of the mean squared error of one of its runs."""
        return float(np.median(self.summary["mse"][run]))


def finished_runs(folders: Sequence[Path]) -> list[FinishedRun]:
    """Reads finished runs, named by the shortest ends of their paths that differ.

    Raises:
        ValueError: a folder is given twice, or is not that of a finished run.
    """
    return [_read(folder, name) for name, folder in named_folders(folders).items()]


def _read(folder: Path, name: str) -> FinishedRun:
    summary = read_summary(folder)
    made = datetime.fromtimestamp((folder / SUMMARY).stat().st_mtime).strftime("%Y-%m-%d %H:%M")
    try:
        return FinishedRun(name, summary, read_comparer(folder / "report.html"), made=made)
    except (OSError, ValueError, KeyError, TypeError):
        lack = f"{name}: its report.html holds no pictures that can be read back"
        return FinishedRun(name, summary, None, lack, made)


def page_of(runs: Sequence[FinishedRun]) -> Report:
    """The page of several runs.

    Raises:
        ValueError: no run has pictures.
    """
    names = ", ".join(run.name for run in runs)
    shown = [run for run in runs if run.comparer]
    if not shown:
        raise ValueError(f"folders: expected a run whose report.html holds pictures, got {names}")
    first, last = runs[0], runs[-1]
    lead = [f"The median error of {last.own} in {last.name} is {last.median(last.own) / first.median(first.own):.3f} "
            f"times that of {first.own} in {first.name}."] if len(runs) > 1 else []  # fmt: skip
    tables = [_difference(runs, part, title) for part, title in (("config", "Options"), ("provenance", "Origins"))]
    return Report(
        title=f"{names} compared",
        lead=[*lead, *(run.lack for run in runs if run.lack)],
        key_numbers=outcome_table(runs),
        comparer=_joined(shown, runs),
        tables=[table for table in tables if table.rows],
    )


def outcome_table(runs: Sequence[FinishedRun]) -> Table:
    """The errors and ratios of each run."""
    rows = []
    for run in runs:
        ratios = run.summary.get("ratio_statistics", {})
        source = run.summary["provenance"]
        rows += [
            (
                run.name,
                name,
                f"{run.median(name):.3e}",
                f"{ratios[name]['median']:.3f}" if name in ratios else "—",
                run.made,
                str(source.get("commit") or "—")[:9],
            )
            for name in (run.own, *run.summary["rivals"])
        ]
    header = ("folder", "run", "median MSE", "ratio to it", "made", "commit")
    note = "The ratio is of the policy's error to that of the rival, the median of the reference times."
    return Table("What came out", header, rows, note, words=2, grouped=True)


def _difference(runs: Sequence[FinishedRun], part: str, title: str) -> Table:
    """Entries that differ between runs."""
    found = [dict(flat(run.summary[part])) for run in runs]
    names = [name for name in dict.fromkeys(name for one in found for name in one) if name not in _UNTOLD]
    rows = [
        (name, *(str(one.get(name, "—")) for one in found))
        for name in names
        if any(one.get(name) != found[0].get(name) for one in found[1:])
    ]
    header = ("name", *(run.name for run in runs))
    return Table(f"{title} that differ", header, rows, f"{title} that are not the same in all.", words=len(header))


def _joined(shown: Sequence[FinishedRun], runs: Sequence[FinishedRun]) -> Comparer:
    """Pictures of all runs by time; a reference that several runs share appears once."""
    labels = _labels(shown)
    times = sorted(step.time_s for run in shown if run.comparer for step in run.comparer.steps)
    times = [t for number, t in enumerate(times) if number == 0 or t - times[number - 1] > _SAME_S]
    panels: dict[str, Panel] = {}
    pictures: list[dict[str, bytes | None]] = [{} for _ in times]
    for run in shown:
        comparer = run.comparer
        assert comparer is not None
        called = labels[run.name]
        for panel in comparer.panels:
            panels.setdefault(
                called[panel.label], replace(panel, label=called[panel.label], truth=called.get(panel.truth, ""))
            )
        for number, step in enumerate(_at(comparer.steps, times)):
            for label, one in (step.pictures if step else {}).items():
                pictures[number].setdefault(called[label], one)
    order = sorted(panels.values(), key=lambda panel: (panel.scale is not None, bool(panel.truth)))
    left, right = (labels[run.name][run.own] for run in (shown[0], shown[-1]))
    steps = [Step(t, one) for t, one in zip(times, pictures, strict=True)]
    return Comparer(order, steps, left, right, list(_plots(runs)), "Pictures and curves are those of the runs' pages.")


def _at(steps: Sequence[Step], times: Sequence[float]) -> Iterable[Step | None]:
    """The step of each time; None if the run has no step within half its period."""
    at = np.array([step.time_s for step in steps])
    near = 0.5 * float(np.median(np.diff(at))) if len(at) > 1 else _SAME_S
    for time_s in times:
        number = int(np.abs(at - time_s).argmin())
        yield steps[number] if abs(at[number] - time_s) <= near + _SAME_S else None


def _labels(shown: Sequence[FinishedRun]) -> dict[str, dict[str, str]]:
    """New labels of the panels of each run, by its name and the old label."""
    references: list[tuple[str, dict[float, bytes | None]]] = []
    found: dict[str, dict[str, str]] = {}
    for run in shown:
        assert run.comparer is not None
        found[run.name] = {panel.label: f"{run.name}: {panel.label}" for panel in run.comparer.panels}
        for panel in run.comparer.panels:
            if panel.truth or panel.scale:
                continue
            own = {round(step.time_s, 6): step.pictures.get(panel.label) for step in run.comparer.steps}
            same = (label for label, other in references if _agree(own, other))
            label = next(same, panel.label if not references else f"{run.name}: {panel.label}")
            references.append((label, own))
            found[run.name][panel.label] = label
    return found


def _agree(one: Mapping[float, bytes | None], other: Mapping[float, bytes | None]) -> bool:
    shared = one.keys() & other.keys()
    return bool(shared) and all(one[t] == other[t] for t in shared)


def _plots(runs: Sequence[FinishedRun]) -> Iterable[Plot]:
    """Errors of all runs, identical ones once, and the error of each policy over that of the first folder."""
    errors: list[Curve] = []
    seen: set[tuple[float, ...]] = set()
    for run in runs:
        for name in (run.own, *run.summary["rivals"]):
            values = tuple(run.summary["mse"][name])
            if values not in seen:
                seen.add(values)
                style = len(errors)
                errors.append(Curve(f"{run.name}: {name}", run.summary["reference_time_s"], values, style))
    yield Plot("Mean squared error of the shown image", "", errors)
    first = runs[0]
    ratios = []
    for number, run in enumerate(runs[1:], 1):
        if run.summary["reference_time_s"] == first.summary["reference_time_s"]:
            ratio = np.asarray(run.summary["mse"][run.own]) / np.asarray(first.summary["mse"][first.own])
            ratios.append(Curve(f"{run.name}: {run.own}", run.summary["reference_time_s"], ratio.tolist(), number))
    if ratios:
        yield Plot(f"Error of each policy over that of {first.own} in {first.name}", "", ratios, level=1.0)
