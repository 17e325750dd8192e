"""Options of the perception study; imports little, so that ``--help`` is quick."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from analysis.command import limits
from analysis.command.cluster import WAIT_S
from analysis.command.options import REFERENCES, References, Scheduler, Threads, WorkerWait
from analysis.metrics.display_model import DisplayModel
from analysis.study.asked import require_distinct, require_inputs
from analysis.study.inputs import INPUTS
from tsar.config import closed_choices, require
from tsar.policies import POLICIES

_ASSETS = Path(__file__).resolve().parents[2] / "scenes" / "assets"
_SIGMAS_JOD = (1e-3, 100.0)
STUDY_JOBS = (_ASSETS / "plane" / "study_job.txt", _ASSETS / "spheres" / "study_job.txt")
"""Job files of the study of the thesis."""


@dataclass(frozen=True)
@closed_choices()
class StimuliOptions:
    """Renders the stimuli of job files, and a manifest with their hashes; continues where it was stopped."""

    jobs: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[JOB ...]")] = ()
    """Job files; the thesis' study where none is named: two scenes, eight levels, three point sets, truncated box."""
    width_px: int = 768
    """Width, pixels; of a frame, also its height."""
    first_frame: int = 60
    """First frame of the sequence."""
    frames: int = 60
    """Number of frames."""
    format: Literal["png", "exr"] = "png"
    """Format of the frames; EXR holds linear radiance, and is shown encoded, like PNG."""
    video: bool = False
    """Also write stimulus.mkv beside the frames of each stimulus, lossless in 8 bits (FFV1)."""
    box_share: float = 0.5
    """Share of the shutter time, in its middle, that the box filter spans."""
    seed: int = 0
    """Seed of all random numbers; of point sets and shifts."""
    threads: Threads = 0
    scheduler: Scheduler = ""
    worker_wait_s: WorkerWait = WAIT_S
    out: Path = Path("out/perception")
    """Folder for the results; the stimuli, manifest.json and summary.json."""

    def __post_init__(self) -> None:
        limits.within(
            self,
            width_px=(16, 8192),
            first_frame=(0, 10**6),
            frames=(1, 10**6),
            box_share=(1e-6, 1.0),
            seed=limits.SEEDS,
            threads=limits.THREADS,
            worker_wait_s=limits.WORKER_WAITS_S,
        )


@dataclass(frozen=True)
class SimulateOptions:
    """Simulates observers that answer the stimuli of a folder; trials-simulated.parquet has one row a trial."""

    stimuli: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="[FOLDER]")] = Path("out/perception")
    """Folder of the command ``stimuli``."""
    observers: int = 12
    """Number of observers."""
    repetitions: int = 4
    """Repetitions of each; answers of an observer to a stimulus."""
    sigma_jod: float = 1.048
    """Noise of a single stimulus, JOD; 1.048 makes one JOD preferred in 75 % of pairs."""
    sensitivity_spread: float = 0.25
    """Standard deviation of the logarithm of the observers' sensitivities."""
    lapse_mean: float = 0.02
    """Mean share of answers that are guesses."""
    display: DisplayModel = field(default_factory=DisplayModel)
    """Display that the JOD assume."""
    seed: int = 0
    """Seed of all random numbers; of observers, orders and answers."""
    out: Path = Path("out/perception-simulated")
    """Folder for the results; trials-simulated.parquet and .csv, jod.csv and summary.json."""

    def __post_init__(self) -> None:
        limits.within(
            self,
            observers=(1, 10_000),
            repetitions=limits.REPETITIONS,
            sigma_jod=_SIGMAS_JOD,
            sensitivity_spread=(0.0, 3.0),
            lapse_mean=(0.0, 0.2),
            seed=limits.SEEDS,
        )
        answers = self.observers * self.repetitions
        limits.require_count("observers", self.observers, answers, "answers to each stimulus", most=10**6)


@dataclass(frozen=True)
@closed_choices()
class AnalyseOptions:
    """Fits psychometric functions to trials, compares scenes and point sets, draws figures 19 to 25 of the thesis."""

    trials: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[TRIALS ...]")] = (
        Path("out/perception-simulated/trials-simulated.parquet"),
    )
    """Tables of trials (CSV or Parquet), such as several sessions; either of people or of simulated observers. They
    have at least the columns observer, samples and correct."""
    guess_rate: float = 0.5
    """Share of right answers by chance."""
    threshold: float = 0.75
    """Share of right answers at the just-noticeable difference."""
    disturbed: Literal["leave-out", "keep"] = "leave-out"
    """Trials that did not fit the window or dropped frames, where the table says so."""
    bootstraps: int = 400
    """Data sets drawn for each interval."""
    seed: int = 0
    """Seed of all random numbers; of these data sets, and of the table of power."""
    psignifit: bool = False
    """Also fit with psignifit, an optional extra, and show its thresholds beside ours."""
    power_repetitions: int = 40
    """Experiments simulated for each cell of the table of power; 0 leaves it out."""
    power_spread: float = 0.5
    """Standard deviation of the observers' thresholds in the table of power, octaves."""
    out: Path = Path("out/perception-analysis")
    """Folder for the results; fits.csv, tests.csv, power.csv, figures and summary.json."""

    def __post_init__(self) -> None:
        limits.within(self, bootstraps=(0, 100_000), power_repetitions=(0, 10_000), seed=limits.SEEDS)
        limits.within(self, power_spread=(0.0, 6.0))
        limits.within(self, guess_rate=(0.0, 0.99), threshold=(0.0, 1.0))
        require(len(self.trials) >= 1, "trials", "at least one table", self.trials)
        usual = (self.guess_rate, self.threshold) == (0.5, 0.75)
        require(usual or not self.psignifit, "psignifit", "the default guess_rate and threshold", self.psignifit)


@dataclass(frozen=True)
class RecoverOptions:
    """Draws answers of observers with known psychometric functions, and counts how often the intervals of the fits
    contain the threshold of the mean function, and how often tests of equal scenes find a difference."""

    jnds: tuple[float, ...] = (40.0, 100.0)
    """True thresholds, samples per pixel; the thesis' are about 40 and 100."""
    sigmas: tuple[float, ...] = (1.0, 2.0)
    """Widths of the functions, octaves."""
    lapses: tuple[float, ...] = (0.0, 0.03)
    """Lapse rates."""
    spreads: tuple[float, ...] = (0.0, 0.5, 1.0)
    """Standard deviations of the observers' thresholds, octaves; each experiment draws its observers."""
    observers: int = 12
    """Number of observers."""
    answers: int = 12
    """Answers of each at each of the eight levels; 4 in each of 3 point sets are 12."""
    experiments: int = 100
    """Studies simulated for each function."""
    bootstraps: int = 400
    """Data sets drawn for each interval."""
    seed: int = 0
    """Seed of all random numbers; of answers and bootstraps."""
    out: Path = Path("out/perception-recovery")
    """Folder for the results; recovery.csv and summary.json."""

    def __post_init__(self) -> None:
        for jnd in self.jnds:
            require(1.0 < jnd < 512.0, "jnds", "between 1 and 512", jnd)
        limits.within(self, sigmas=(0.25, 6.0), lapses=(0.0, 0.08), spreads=(0.0, 4.0), seed=limits.SEEDS)
        limits.within(self, observers=(1, 1000), answers=(1, 1000))
        limits.within(self, experiments=(1, 100_000), bootstraps=(20, 100_000))
        functions = len(self.jnds) * len(self.sigmas) * len(self.lapses) * len(self.spreads)
        fits = functions * self.experiments * self.bootstraps
        limits.require_count("experiments", self.experiments, fits, "fits", most=10**8)


@dataclass(frozen=True)
class ServeOptions:
    """Shows the trials to a person on a page of this machine; continues where it was stopped."""

    observer: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="OBSERVER")]
    """Name of the person in the table of trials."""
    stimuli: Path = Path("out/perception")
    """Folder of the command ``stimuli``."""
    repetitions: int = 4
    """Repetitions of each; times that a stimulus is shown."""
    break_every: int = 24
    """Trials between breaks."""
    port: int = 0
    """Port of the page; on this machine only; 0 takes a free one."""
    seed: int = 0
    """Seed of all random numbers; of orders and sides."""
    out: Path = Path("out/perception-human")
    """Folder for the results; the session: answers.sqlite, trials-human.parquet and .csv, and summary.json."""

    def __post_init__(self) -> None:
        require(bool(self.observer.strip()), "observer", "a name", self.observer)
        limits.within(self, repetitions=(1, 100), break_every=(1, 10**6), port=(0, 65535), seed=limits.SEEDS)


@dataclass(frozen=True)
@closed_choices()
class AdaptiveOptions:
    """Shows a policy and the framed renderer to the simulated observer, at equal cost and by batch size."""

    inputs: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[INPUT ...]")] = INPUTS
    """Built-in inputs, or other scenes by their names."""
    policy: str = "thesis"
    """Policy that decides what is sampled, by name; the observer compares it with framed."""
    scale: Literal["thesis", "half", "quick"] = "quick"
    """Sizes of the runs: as in the suitability study."""
    jod_span_s: tuple[float, float] = (0.4, 0.9)
    """Beginning and end of the part of each run that ColorVideoVDP scores, seconds after the start."""
    sigma_jod: float = 1.048
    """Noise of a single stimulus, JOD."""
    display: DisplayModel = field(default_factory=DisplayModel)
    """Display that the JOD assume."""
    workers: int = 0
    """Processes of the local cluster; 0 takes one per core."""
    seed: int = 0
    """Seed of all random numbers; of the runs."""
    references: References = REFERENCES
    out: Path = Path("out/perception-adaptive")
    """Folder for the results; the runs, adaptive.csv, thresholds.csv and summary.json."""

    def __post_init__(self) -> None:
        require_distinct(self, "inputs")
        require_inputs(self.inputs)
        POLICIES.require(self.policy, "policy")
        require(self.policy != "framed", "policy", "one other than framed", self.policy)
        limits.within(self, sigma_jod=_SIGMAS_JOD, workers=limits.WORKERS, seed=limits.SEEDS)
        require(
            0.0 <= self.jod_span_s[0] < self.jod_span_s[1] <= 2.0,
            "jod_span_s",
            "from and to within the 2 s",
            self.jod_span_s,
        )


@dataclass(frozen=True)
class FiguresOptions:
    """Draws figures 3, 6, 8, 10, 15, 17 and 18 of the thesis: sampling in time and space, and both scenes."""

    width_px: int = 192
    """Width, pixels; of a frame, also its height."""
    samples: int = 64
    """Samples per pixel."""
    seed: int = 0
    """Seed of all random numbers; of shifts."""
    threads: Threads = 0
    out: Path = Path("out/perception-figures")
    """Folder for the results; figures and summary.json."""

    def __post_init__(self) -> None:
        limits.within(self, width_px=(16, 2048), samples=(8, 4096), seed=limits.SEEDS, threads=limits.THREADS)


@dataclass(frozen=True)
class AnomalyOptions:
    """Measures how much random stratified sets differ, and whether that explains the anomaly at 216 samples."""

    levels: tuple[int, ...] = (125, 216, 343)
    """Numbers of points, which must be cubes."""
    sets: int = 16
    """Point sets of each number of samples."""
    shifts: int = 3
    """Shifts of each set."""
    studies: int = 20_000
    """Studies of observers that are simulated."""
    width_px: int = 48
    """Width, pixels; of a frame, also its height."""
    seed: int = 0
    """Seed of all random numbers; of sets, shifts and observers."""
    threads: Threads = 0
    out: Path = Path("out/perception-anomaly")
    """Folder for the results; anomaly.csv and summary.json."""

    def __post_init__(self) -> None:
        require_distinct(self, "levels")
        for level in self.levels:
            require(1 <= level <= 4096 and round(level ** (1 / 3)) ** 3 == level, "levels", "cubes to 4096", level)
        require(len(self.levels) >= 2, "levels", "at least two", self.levels)
        limits.within(self, sets=(2, 256), shifts=(2, 64), studies=(100, 10**6), width_px=(16, 512))
        limits.within(self, seed=(0, limits.SEEDS[1] - 256), threads=limits.THREADS)


StepOptions = (
    Annotated[StimuliOptions, tyro.conf.subcommand("stimuli")]
    | Annotated[SimulateOptions, tyro.conf.subcommand("simulate")]
    | Annotated[ServeOptions, tyro.conf.subcommand("serve")]
    | Annotated[AdaptiveOptions, tyro.conf.subcommand("adaptive")]
    | Annotated[AnalyseOptions, tyro.conf.subcommand("analyse")]
    | Annotated[RecoverOptions, tyro.conf.subcommand("recover")]
    | Annotated[FiguresOptions, tyro.conf.subcommand("figures")]
    | Annotated[AnomalyOptions, tyro.conf.subcommand("anomaly")]
)
"""One step of the study, chosen by its name on the command line."""
