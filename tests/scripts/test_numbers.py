"""Every number of every command has bounds: impossible values are refused in one line, before anything runs."""

import dataclasses
import math
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from analysis.ablation.options import AblationOptions
from analysis.bench.options import BenchOptions
from analysis.comparison.options import RunOptions
from analysis.comparison.repetitions import InputsOptions
from analysis.conversion.options import CheckOptions
from analysis.cost_report.options import CostReportOptions
from analysis.live.options import LiveOptions
from analysis.perception.options import (
    AdaptiveOptions,
    AnalyseOptions,
    RecoverOptions,
    ServeOptions,
    SimulateOptions,
    StimuliOptions,
)
from analysis.precision.options import PrecisionOptions
from analysis.sensitivity.options import SensitivityOptions
from analysis.spectrum.options import SpectrumOptions
from analysis.suitability.options import SuitabilityOptions
from analysis.tracer.options import (
    AcceleratorOptions,
    GalleryOptions,
    JobOptions,
    PointSetOptions,
    TileOptions,
)
from analysis.tracer.render_options import RenderOptions
from analysis.trade.options import TradeOptions
from analysis.workloads.options import WorkloadOptions
from tests.scripts.commands import assert_refused, call_script, nothing_in, one_line, run_script

ROOT = Path(__file__).resolve().parents[2]

OPTIONS: dict[str, Any] = {
    "ablation.py": AblationOptions(),
    "workloads.py": WorkloadOptions(),
    "accelerators.py": AcceleratorOptions(),
    "bench.py": BenchOptions(),
    "conversion_check.py": CheckOptions(markers=True),
    "cost_report.py": CostReportOptions(),
    "gallery.py": GalleryOptions(),
    "inputs.py": InputsOptions(),
    "job.py": JobOptions(Path("job.txt")),
    "live.py": LiveOptions("fly-by"),
    "perception.py adaptive": AdaptiveOptions(),
    "perception.py analyse": AnalyseOptions(),
    "perception.py recover": RecoverOptions(),
    "perception.py serve": ServeOptions("ANNA"),
    "perception.py simulate": SimulateOptions(),
    "perception.py stimuli": StimuliOptions(),
    "pointsets.py": PointSetOptions(),
    "precision.py": PrecisionOptions(),
    "render.py": RenderOptions("glass"),
    "run.py": RunOptions("fly-by"),
    "sensitivity.py": SensitivityOptions(),
    "spectrum.py": SpectrumOptions(),
    "suitability.py": SuitabilityOptions(),
    "tiles.py": TileOptions("glass"),
    "trade.py": TradeOptions(),
}
"""The options of each command at their defaults."""

WITHOUT_NUMBERS = {"convert.py", "report.py", "same.py"}
HOPELESS = (math.nan, math.inf, -math.inf, 1e300, -1e300, 10**20, -(10**20))
PLAUSIBLE = (-1, 0)

Place = tuple[str, ...]


def numbers(options: Any, place: Place = ()) -> Iterator[tuple[Place, type, bool]]:
    """Where each number of a record lies, its kind, and whether there may be several."""
    hints = typing.get_type_hints(type(options))
    for item in dataclasses.fields(options):
        value, hint = getattr(options, item.name), hints[item.name]
        if dataclasses.is_dataclass(value):
            yield from numbers(value, (*place, item.name))
            continue
        kinds = {hint, *typing.get_args(hint)}
        for kind in (float, int):
            if kind in kinds:
                yield (*place, item.name), kind, typing.get_origin(hint) is tuple


def changed(options: Any, place: Place, value: Any) -> Any:
    """The record with another value at a place."""
    first, *rest = place
    return dataclasses.replace(
        options, **{first: changed(getattr(options, first), tuple(rest), value) if rest else value}
    )


def variants(options: Any, place: Place, several: bool, number: float) -> list[Any]:
    """What the field is with this number in it; each of several in turn."""
    if not several:
        return [number]
    old = options
    for name in place:
        old = getattr(old, name)
    old = old or (number,)
    return [(*old[:at], number, *old[at + 1 :]) for at in range(len(old))]


CASES = [
    pytest.param(options, *found, id=f"{command} {'.'.join(found[0])}")
    for command, options in OPTIONS.items()
    for found in numbers(options)
]


def test_no_command_is_left_out() -> None:
    scripts = {path.name for path in (ROOT / "scripts").glob("*.py")}
    assert scripts == {command.split()[0] for command in OPTIONS} | WITHOUT_NUMBERS
    assert len(CASES) > 150


@pytest.mark.parametrize(("options", "place", "kind", "several"), CASES)
def test_numbers_that_no_run_could_serve_are_refused(options: Any, place: Place, kind: type, several: bool) -> None:
    for number in HOPELESS:
        if kind is int and not isinstance(number, int):
            continue  # the command line takes whole numbers only
        for value in variants(options, place, several, kind(number)):
            with pytest.raises(ValueError, match=f"(?s){place[-1]}.*expected.*got") as refused:
                changed(options, place, value)
            assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("options", "place", "kind", "several"), CASES)
def test_small_numbers_are_taken_or_refused(options: Any, place: Place, kind: type, several: bool) -> None:
    for number in PLAUSIBLE:
        for value in variants(options, place, several, kind(number)):
            try:
                changed(options, place, value)
            except ValueError as refused:
                assert "expected" in str(refused) and "\n" not in str(refused)


ABSURD = {
    "run.py": [
        ("--seed", "99999999999999999999"),
        ("--cache-size", "100000000"),
        ("--seconds", "1e9"),
        ("--seconds", "1e5", "--reference-rate-hz", "1e5"),
        ("--start-s", "1e300"),
        ("--start-s", "1e15"),
        ("--start-s", "1e9", "--capacity", "1e15", "--seconds", "1e-3"),
        ("--capacity", "1e30"),
        ("--capacity", "1e20"),
        ("--capacity", "1e-9"),
        ("--capacity", "1e30", "--ledger", "work"),
        ("--capacity", "1e-9", "--ledger", "work"),
        ("--warmup-cycles", "1000000000"),
        ("--threads", "100000"),
        ("--gain", "inf"),
        ("--phase", "nan"),
        ("--seconds", "[/b]"),
    ],
    "inputs.py": [("--capacity", "1e-9"), ("--seconds", "1e9"), ("--repetitions", "1000000")],
    "render.py": [("--time-s", "1e15"), ("--fps", "1e-300"), ("--threads", "100000"), ("--frames", "1e9")],
    "cost_report.py": [("--measured-warmup", "1000000000"), ("--repetitions", "1000", "--cycles-per-turn", "10000")],
    "ablation.py": [("--framed-rate-hz", "1e300"), ("--before-s", "inf"), ("--workers", "100000")],
    "suitability.py": [("--framed-rate-hz", "1e300"), ("--start-s", "nan"), ("--workers", "100000")],
    "perception.py": [("recover", "--experiments", "100000", "--bootstraps", "100000")],
    "tiles.py": [("--workers", "100000"), ("--time-s", "inf")],
}
"""Command lines that ended in a traceback or never, or would have."""


@pytest.mark.parametrize(
    ("script", "arguments"), [(script, arguments) for script, several in ABSURD.items() for arguments in several]
)
def test_absurd_runs_are_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, script: str, arguments: Place
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = {"run.py": ("fly-by",), "render.py": ("glass",), "tiles.py": ("glass",)}.get(script, ())
    assert call_script(script, monkeypatch, *scene, *arguments) == 2
    shown = capsys.readouterr()
    assert shown.out == "" and one_line(shown.err), shown.err
    option = next(part for part in arguments if part.startswith("--")).removeprefix("--").rpartition(".")[2]
    assert option in shown.err or option.replace("-", "_") in shown.err or "capacity" in shown.err
    assert nothing_in(tmp_path)


@pytest.mark.parametrize("arguments", [("--capacity", "1e30"), ("--start-s", "1e15"), ("--threads", "100000")])
def test_what_never_ended_ends(tmp_path: Path, arguments: Place) -> None:
    """In a process of its own, which is stopped where it hangs."""
    done = run_script("run.py", tmp_path, "fly-by", *arguments, timeout_s=60)
    assert done.returncode == 2 and one_line(done.stderr), done.stderr
    assert nothing_in(tmp_path)


@pytest.mark.parametrize(
    ("script", "arguments"),
    [
        ("run.py", ("fly-by", "--cache-size", "1048576")),
        ("render.py", ("glass", "--width-px", "32768", "--height-px", "32768", "--samples", "4")),
        ("gallery.py", ("glass", "--width-px", "32768", "--height-px", "32768")),
        ("tiles.py", ("report-one", "--width-px", "32768", "--height-px", "32768")),
        ("job.py", (str(ROOT / "scenes/assets/plane/plane_job.txt"), "--width-px", "32768")),
    ],
)
def test_pictures_that_memory_does_not_hold_are_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, script: str, arguments: Place
) -> None:
    for module in ("analysis.command.cli", "renderer.tables.checks"):
        monkeypatch.setattr(f"{module}.free_memory_bytes", lambda: 1 << 30)
    monkeypatch.chdir(tmp_path)
    assert_refused(call_script(script, monkeypatch, *arguments), capsys, ("GiB of memory", "1.0 GiB are free"))
    assert nothing_in(tmp_path)


def test_a_run_that_shows_no_cycle_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    size = ("--resolution-px", "64", "--batch-size", "16", "--reference-samples-per-axis", "1", "--threads", "1")
    span = ("--seconds", "0.01", "--reference-rate-hz", "20", "--capacity", "3e10")
    runs = ("--policy", "thesis", "--rivals", "framed")
    places = ("--out", str(tmp_path / "out"), "--references", str(tmp_path / "cache"))
    assert call_script("run.py", monkeypatch, "fly-by", *size, *span, *runs, *places) == 2
    shown = capsys.readouterr()
    assert shown.out == "" and shown.err.splitlines()[-1].startswith("error: seconds: expected time for a cycle")
    assert nothing_in(tmp_path / "out")
