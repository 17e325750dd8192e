"""The files of a comparison on disk: their names, checks that they are whole, and the hash of their inputs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from analysis.command.cli import bad_input
from analysis.command.start import first_imports
from analysis.comparison.options import RunOptions
from analysis.metrics import METRICS
from analysis.storage.results import SUMMARY
from analysis.study.inputs import tables_of
from tsar.choices import chosen
from tsar.policies import POLICIES

if TYPE_CHECKING:
    from analysis.storage.records import StepWriter
    from analysis.storage.source import Brought
    from scenes.canonical import Scene
    from tsar.types import StepRecord

FILES = ("steps.parquet", "error.png", "error.svg", "report.html", "comparison.mp4")


def names_of(options: RunOptions) -> tuple[str, ...]:
    """Names, or patterns of names, of all files that a run may write beside its summary."""
    folders = {"frames/*.exr": options.write_frames, "layers/*.exr": options.layered_stills}
    return (*FILES, *(name for name, asked in folders.items() if asked))


@dataclass
class Recording:
    """Writes the cycles of the first run that records any: the run's own policy, which begins first, or else the
    first of its rivals. Changes in place.

    Attributes:
        writer: destination of the records.
        name: name of that run; None if no run records cycles.
    """

    writer: StepWriter
    name: str | None = None

    def of(self, run: str) -> Callable[[StepRecord], None]:
        """The callback that takes the records of a run's cycles."""

        def add(record: StepRecord) -> None:
            self.name = self.name or run
            if self.name == run:
                self.writer.add(record)

        return add


def finished(options: RunOptions) -> dict[str, Any] | None:
    """The summary of a finished run with these options, the current code and the current scene; or None.

    A run is finished if all of its files are unchanged; damaged files are named.

    Raises:
        InputError: the scene cannot be read.
    """
    with first_imports():
        from analysis.storage.store import Store
        from scenes import catalog

    with bad_input():
        scene, _ = catalog.load_seen(options.input, options.look, options.phase, options.camera_path)
        store = Store(options.out, content_of(options, scene))
        found = store.read_json(SUMMARY, {"provenance": dict, "policy": str, "files": list[str]})
    return found if found and all(store.find(name) is not None for name in found["files"]) else None


def content_of(options: RunOptions, scene: Scene) -> str:
    """Hash of everything that decides the results of a run: options, the scene's content, and the code."""
    from analysis.comparison.experiment import run_experiment
    from analysis.storage.files import plain
    from analysis.storage.reference import content_hash
    from analysis.storage.source import code_hash
    from scenes.models.scenes_of_models import content_of as content

    facets = options.integrator == "path"
    kept = {name: value for name, value in plain(options).items() if name not in ("out", "references")}
    return content_hash((kept, content(options.input, scene, facets), code_hash(run_experiment), *added_by(options)))


def complete_run(options: RunOptions, summary: dict[str, Any]) -> dict[str, Any]:
    """Lists the files of a run that has ended, and writes its summary last: from then on the run is complete.

    Returns:
        The content of the summary: the given one with the files.
    """
    from analysis.storage.store import Store

    store = Store(options.out, summary["provenance"]["content"])
    files = [name for name in FILES if (options.out / name).exists()]
    for name in files:
        store.add(name)
    summary = {**summary, "files": files}
    store.write_json(SUMMARY, summary)
    return summary


def added_by(options: RunOptions) -> list[Brought]:
    """The additions of other packages that a run uses."""
    from analysis.storage.source import brought

    policies = ((POLICIES, name) for name in (options.policy, *options.rivals))
    metrics = ((METRICS, name) for name in options.further_metrics)
    return brought(*policies, *metrics, *chosen(options.tsar), *tables_of(options.input))
