"""Runs many cases on many processes or machines; each result is durable before it counts.

Cases are independent, so Dask distributes them: by default on a cluster on this machine, or on any other by its
address, whose workers see the same folders and run the same source.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from analysis.command.awaited import ended, not_shared, unseen
from analysis.command.cli import bad_input, full_disk
from analysis.command.cluster import ClusterOptions, connected
from analysis.command.ownership import writable_folder
from analysis.command.progress import Task, bars
from analysis.storage.files import PARTIAL
from analysis.storage.results import SUMMARY, own_results
from analysis.study.cases import Case, MovingScene, Scale, content_of

if TYPE_CHECKING:
    from distributed import Client, Future

    from analysis.study.evaluation import Resources
    from analysis.study.outcomes import Outcomes


class StudyOptions(Protocol):
    """Options that every study has."""

    @property
    def out(self) -> Path: ...
    @property
    def references(self) -> Path: ...
    @property
    def farm(self) -> ClusterOptions: ...


def run_study(options: StudyOptions, cases: Sequence[Case], written: Sequence[str]) -> Outcomes:
    """Takes over the folder of a study and runs its cases, with a bar.

    Args:
        options: options of the study.
        cases: the cases.
        written: names and patterns of the files that the study will write, relative to its folder.

    Raises:
        InputError: a folder cannot be created or locked, or nothing answers at the scheduler's address.
    """
    from analysis.study.evaluation import Resources
    from analysis.study.outcomes import Outcomes

    with bad_input():
        own_results(options.out, tuple(written))
        writable_folder(options.references, "references")
    out = options.out.resolve()
    (out / SUMMARY).unlink(missing_ok=True)  # so that a killed study leaves no older summary
    place = Resources(out / "runs", options.references.resolve(), options.farm.threads)
    with full_disk(out), bars() as shown:
        place.results.mkdir(exist_ok=True)
        task = shown.task("runs", len(set(cases)))
        return Outcomes(place, *run_cases(cases, place, options.farm, task, shown.say))


def run_cases(
    cases: Sequence[Case],
    place: Resources,
    options: ClusterOptions,
    task: Task | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> tuple[dict[Case, str], dict[Case, str]]:
    """Runs every case whose result is not on disk yet; a case that fails does not stop the others.

    Args:
        cases: the cases; one that occurs twice is run once.
        place: destination of results and references; on a cluster, folders that all of its machines see.
        options: the cluster.
        task: progress, one step a case.
        say: prints a line.

    Returns:
        The key of every case's result, and the reason of every failure.
    """
    from analysis.study.evaluation import finished, source_of_results

    source = source_of_results()
    content_of.cache_clear()
    keys = {case: case.key(source) for case in dict.fromkeys(cases)}
    missing = [case for case in keys if finished(keys[case], place) is None]
    task, failures = task or Task(), dict[Case, str]()
    task.advance(len(keys) - len(missing))
    if not missing:
        return keys, failures
    try:
        with connected(options, say) as client:
            client.run(_forget_scenes, on_error="ignore")
            waiting = _submit(client, missing, keys, place, options.retries)
            for case, _, reason in ended(client, waiting, options.worker_wait_s):
                if reason is not None:
                    failures[case] = reason
                task.advance()
            written = {place.results / f"{keys[case]}.json": case for case in missing if case not in failures}
            for file in unseen(written) if options.scheduler else ():
                failures[written[file]] = not_shared(place.results)
    except KeyboardInterrupt:
        if not options.scheduler:  # the workers cannot remove it once they are gone
            for left in place.results.rglob(f"*{PARTIAL}*"):
                left.unlink(missing_ok=True)
        raise
    return keys, failures


def _forget_scenes() -> None:
    """For workers that have run earlier studies."""
    from analysis.study.scenery import forget

    forget()


def describe_failures(failures: Mapping[str, str]) -> list[str]:
    """A line for each reason, with the name of the first run that failed for it and the number of others."""
    by_reason: dict[str, list[str]] = {}
    for name, reason in failures.items():
        by_reason.setdefault(reason, []).append(name)
    return [
        f"failed: {names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {reason}"
        for reason, names in by_reason.items()
    ]


@cache
def _keep_freed_memory() -> None:
    """Makes a worker keep the memory that it frees, in one heap for all of its threads.

    A worker allocates and frees hundreds of images a second. By default glibc returns each to the system, and
    allocating them again takes a third of the worker's time. With another C library this function does nothing.
    """
    arena_max, mmap_threshold, trim_threshold = -8, -3, -1
    try:
        tune = ctypes.CDLL("libc.so.6").mallopt
    except (OSError, AttributeError):
        return
    for option, value in ((arena_max, 1), (mmap_threshold, 1 << 30), (trim_threshold, (1 << 31) - 1)):
        tune(option, value)


def _submit(
    client: Client, missing: Sequence[Case], keys: dict[Case, str], place: Resources, retries: int
) -> dict[Future, Case]:
    """Futures of the cases, each after that of its reference, in an order that puts the references early."""
    references = {_reference_of(case): None for case in missing}
    behind = {wanted: client.submit(_prepare, *wanted, place, pure=False, retries=retries) for wanted in references}
    return {
        client.submit(
            _evaluate, case, keys[case], place, behind[_reference_of(case)], pure=False, retries=retries
        ): case
        for case in missing
    }


def _reference_of(case: Case) -> tuple[MovingScene, float, Scale]:
    return case.animation, case.start_s, case.scale


def _prepare(animation: MovingScene, start_s: float, scale: Scale, place: Resources) -> None:
    from analysis.study.scenery import render_reference

    _keep_freed_memory()
    render_reference(animation, start_s, scale, place.references, place.threads)


def _evaluate(case: Case, key: str, place: Resources, reference: None) -> str:
    from analysis.study.evaluation import evaluate

    _keep_freed_memory()
    return evaluate(case, key, place)
