"""Runs the steps of the study, each from its options to files and a few lines of text."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from analysis.command.cli import InputError, bad_input, full_disk
from analysis.command.interrupts import settled
from analysis.command.progress import Bars, bars
from analysis.perception import analysis as analyses
from analysis.perception import nulls, plots
from analysis.perception.observers import TASK, drawn_observers, simulated_trials
from analysis.perception.options import (
    AdaptiveOptions,
    AnalyseOptions,
    AnomalyOptions,
    FiguresOptions,
    RecoverOptions,
    ServeOptions,
    SimulateOptions,
    StimuliOptions,
)
from analysis.perception.protocol import TrialSession
from analysis.perception.psychometrics import Rule
from analysis.perception.server import serving
from analysis.perception.stimuli import differences, render_stimuli
from analysis.perception.trials import CONDITIONS, read_trials, undisturbed
from analysis.storage.files import atomic, write_table
from analysis.storage.results import reserved
from analysis.storage.summary import write_summary
from analysis.tracer.options import LEVELS

Found = tuple[dict[str, Any], str]
Options = (
    StimuliOptions | SimulateOptions | ServeOptions | AdaptiveOptions | AnalyseOptions | RecoverOptions
    | FiguresOptions | AnomalyOptions
)  # fmt: skip

SIGMAS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.048, 2.0)
"""Noise of a stimulus in the sweep of the observer, JOD."""

POWER_OBSERVERS, POWER_ANSWERS = (6, 12, 24, 48), (4, 12)

_TABLES = ("*.csv", "*.png")
_FILES = {
    StimuliOptions: ("manifest.json",),
    SimulateOptions: (*_TABLES, "trials-simulated.parquet"),
    ServeOptions: ("trials-human.parquet", "trials-human.csv"),
}


def run(options: Options) -> str:
    """Runs one step of the study and writes its summary; returns a few lines of text about it.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    from renderer.film.files import FilmError

    steps: dict[type, Callable[[Any, Bars], Found]] = {
        StimuliOptions: stimuli,
        SimulateOptions: simulate,
        ServeOptions: serve,
        AdaptiveOptions: adaptive,
        AnalyseOptions: analyse,
        RecoverOptions: recover,
        FiguresOptions: figures,
        AnomalyOptions: anomaly,
    }
    names = _FILES.get(type(options), _TABLES)
    with bad_input(), reserved(options.out, names), full_disk(options.out, FilmError), bars() as shown:
        found, text = steps[type(options)](options, shown)
        write_summary(options.out, found, options, seed=options.seed)
    return text


def stimuli(options: StimuliOptions, bars: Bars) -> Found:
    """Renders stimuli and their manifest."""
    manifest = render_stimuli(options, bars)
    rows = manifest["stimuli"]
    rendered, frames = sum(row["rendered_now"] for row in rows), sum(len(row["files"]) for row in rows)
    summary = {"stimuli": len(rows), "frames": frames, "rendered_now": rendered}
    summary["nonfinite"] = sum(row["nonfinite"] for row in rows)
    return summary, f"{len(rows)} stimuli, {frames} frames ({rendered} rendered now)"


def simulate(options: SimulateOptions, bars: Bars) -> Found:
    """Scores stimuli in JOD and has simulated observers answer."""
    jod = differences(options.stimuli, options.display, bars)
    people = drawn_observers(options.observers, options.seed, options.sensitivity_spread, options.lapse_mean)
    trials = simulated_trials(jod, people, options.repetitions, options.seed, options.sigma_jod)
    write_table(options.out / "jod.csv", jod)
    with atomic(options.out / "trials-simulated.parquet") as path:
        trials.to_parquet(path, index=False)
    write_table(options.out / "trials-simulated.csv", trials)
    sweep = []
    for sigma in SIGMAS:
        swept = simulated_trials(jod, people, options.repetitions, options.seed, sigma)
        for scene in dict.fromkeys(jod["scene"]):
            row = analyses.fit_row(swept.loc[swept["scene"] == scene], 0, options.seed)
            sweep.append({"sigma_jod": sigma, "scene": scene, **row})
    table = pd.DataFrame(sweep)
    write_table(options.out / "sigma_sweep.csv", table)
    from analysis.page.figures import save

    save(plots.sweep_figure(table, list(dict.fromkeys(jod["scene"]))), options.out / "sigma_sweep.png")
    found = {
        "task": TASK,
        "observers": [vars(one) for one in people],
        "display": vars(options.display),
        "trials": len(trials),
        "sigma_sweep": sweep,
    }
    return found, f"{len(trials)} trials of {len(people)} simulated observers ({TASK}), sigma {options.sigma_jod:g} JOD"


def serve(options: ServeOptions, bars: Bars) -> Found:
    """Shows trials to a person until all are answered, or until this is interrupted."""
    with TrialSession(options.out, options.stimuli, options.observer, options.repetitions, options.seed) as session:
        _answered(session, options, bars)
    table = session.table()
    late = int(np.count_nonzero(table["dropped_frames"].to_numpy() > 0))
    found = {"observer": options.observer, "trials": len(session.trials), "answered": len(table), "with_dropped": late}
    return found, f"{len(table)} of {len(session.trials)} trials answered, {late} with late frames"


def _answered(session: TrialSession, options: ServeOptions, bars: Bars) -> None:
    task = bars.task("answers", len(session.trials))
    task.reach(len(session.answers))
    try:
        with serving(session, options.port, options.break_every) as address:
            bars.say(f"open {address} in a browser; Ctrl-C ends, and the same command continues")
            while session.current is not None:
                time.sleep(0.2)
                task.reach(len(session.answers))
                if session.fault is not None:
                    time.sleep(1.0)  # so that the page learns of it
                    raise session.fault
            time.sleep(1.0)  # so that the page learns of its last answer
    except KeyboardInterrupt:
        settled()  # answers are on disk


def adaptive(options: AdaptiveOptions, bars: Bars) -> Found:
    """Shows a policy and the framed renderer to the same observer."""
    from analysis.perception.adaptive import judged, scores, thresholds

    table = judged(scores(options, bars.task("runs", 12 * len(options.inputs))), options.sigma_jod)
    found = thresholds(table)
    for name, rows in (("adaptive", table), ("thresholds", found)):
        write_table(options.out / f"{name}.csv", rows)
    lines = [
        f"{row['input']}: {options.policy} noticed at batch {row['noticed_at']}, preferred to framed at "
        f"{row['preferred_at']}, framed preferred at {row['framed_preferred_at']}"
        for row in found.to_dict("records")
    ]
    return {"rows": table.to_dict("records"), "thresholds": found.to_dict("records")}, "\n".join(lines)


def recover(options: RecoverOptions, bars: Bars) -> Found:
    """Fits answers drawn from known functions."""
    cases = list(product(options.jnds, options.sigmas, options.lapses, options.spreads))
    task, rows = bars.task("studies", options.experiments * (len(cases) + len(options.spreads))), []
    for case in cases:
        people, sizes = (options.observers, options.answers), (options.experiments, options.bootstraps)
        rows.append(analyses.recovery(LEVELS, *case, people, *sizes, options.seed, task.advance))
    tests = [nulls.false_positives(options, spread, task.advance) for spread in options.spreads]
    table = pd.DataFrame(rows)
    write_table(options.out / "recovery.csv", table)
    lines = [
        f"JND {row['jnd']:g}, width {row['sigma']:g} octaves, lapses {row['lapse']:g}, observers "
        f"{row['spread']:g} octaves apart: the 95 % interval holds it in "
        f"{100 * row['coverage']:.1f} % ({100 * row['coverage_low']:.1f} – {100 * row['coverage_high']:.1f}), "
        f"median of the fits over it {row['jnd_ratio_median']:.3f}"
        for row in rows
    ]
    return {"rows": rows, "tests": tests}, "\n".join([*lines, *map(nulls.described, tests)])


def figures(options: FiguresOptions, bars: Bars) -> Found:
    """Draws the figures of the thesis about sampling and scenes."""
    from analysis.page.figures import save
    from analysis.perception.thesis_figures import FRAMES, densities, pictures

    drawn = pictures(options, bars.task("frames", FRAMES))
    for name, row in drawn.items():
        save(plots.row_figure(row), options.out / f"{name}.png")
    save(plots.densities_figure(densities()), options.out / "time_filters.png")
    names = [*drawn, "time_filters"]
    return {"figures": names}, f"figures: {', '.join(names)}"


def anomaly(options: AnomalyOptions, bars: Bars) -> Found:
    """Measures whether the point set explains the anomaly at 216 samples."""
    from analysis.perception.anomaly import SCENES, chance_rises, described, errors, table

    task = bars.task("sets", len(SCENES) * (1 + len(options.levels) * options.sets))
    rows = pd.concat([table(errors(scene, options, task), scene) for scene in SCENES], ignore_index=True)
    write_table(options.out / "anomaly.csv", rows)
    rises = chance_rises(options)
    found = {"rows": rows.to_dict("records"), "rises": {str(least): share for least, share in rises.items()}}
    return found, described(rows, rises)


def analyse(options: AnalyseOptions, bars: Bars) -> Found:
    """Fits, tests, power and figures from a table of trials."""
    rule = Rule(options.guess_rate, options.threshold)
    trials, kind = read_trials(options.trials)
    kept = undisturbed(trials) if options.disturbed == "leave-out" else trials
    if kept.empty:
        raise InputError("disturbed: expected trials that fit the window and dropped no frame, got none")
    left_out, trials = len(trials) - len(kept), kept
    task = bars.task("analysis", 4)
    fitted = analyses.fits(trials, options.bootstraps, options.seed, options.psignifit, rule)
    task.advance()
    tested = analyses.comparisons(trials)
    task.advance()
    _figures(options, trials, kind, rule)
    task.advance()
    pairs = analyses.strongest(tested)
    tables = {"fits": fitted, "tests": tested, "pairs": pairs}
    if options.power_repetitions and len(set(trials["samples"])) > 1:
        levels = sorted(int(level) for level in trials["samples"].unique())
        jnds = (analyses.THESIS_JND["planescene"], analyses.THESIS_JND["spheresscene"])
        width = float(np.nanmedian(fitted["sigma"].to_numpy(np.float64))) if "sigma" in fitted else 1.5
        tables["power"] = analyses.power(
            levels, jnds, width, POWER_OBSERVERS, POWER_ANSWERS, options.power_repetitions, options.seed,
            options.power_spread,
        )  # fmt: skip
    task.advance()
    for name, rows in tables.items():
        write_table(options.out / f"{name}.csv", rows)
    found = {name: rows.to_dict("records") for name, rows in tables.items()}
    found = {"observer_kind": kind, "left_out": left_out, "thesis_jnd": analyses.THESIS_JND, **found}
    said = f"{left_out} trials left out (they did not fit the window, or dropped frames)\n" if left_out else ""
    return found, said + _text(fitted, tested, pairs, kind)


def _figures(options: AnalyseOptions, trials: pd.DataFrame, kind: str, rule: Rule) -> None:
    """Figures 19 to 25: shares of right answers by scene and by point set, each value alone and all together, for the
    first filter; and one figure by filter if there are several.
    """
    from analysis.page.figures import save

    def fitted(part: pd.DataFrame) -> dict[str, Any]:
        return analyses.fit_row(part, 0, options.seed, rule=rule)

    filters = list(dict.fromkeys(trials["time_filter"]))
    alone = trials.loc[trials["time_filter"] == filters[0]]
    for column, name in (("scene", "scenes"), ("point_set", "point_sets")):
        values = sorted(set(alone[column]))
        rows = {value: fitted(alone.loc[alone[column] == value]) for value in values}
        save(plots.psychometric_figure(alone, column, rows, kind, rule), options.out / f"{name}.png")
        for value in values:
            one = plots.psychometric_figure(alone, column, {value: rows[value]}, kind, rule)
            save(one, options.out / f"{value}.png")
    if len(filters) > 1:
        column = "time_filter"
        rows = {value: fitted(trials.loc[trials[column] == value]) for value in filters}
        save(plots.psychometric_figure(trials, column, rows, kind, rule), options.out / "time_filters.png")


def _text(fitted: pd.DataFrame, tested: pd.DataFrame, pairs: pd.DataFrame, kind: str) -> str:
    lines = [f"{kind} observers"]
    shown = [["scene"], ["point_set", "time_filter"]]
    if len(set(fitted["time_filter"].dropna())) > 1:
        shown.append(["scene", "time_filter"])
    for row in fitted.to_dict("records"):
        of = [name for name in CONDITIONS if not pd.isna(row[name])]
        if of not in shown:
            continue  # in the table
        jnd, beside = f"{row['status']} all levels", analyses.THESIS_JND.get(row["scene"])
        if row["status"] == "within":
            jnd = f"{row['jnd']:.1f} ({row['low']:.1f} – {row['high']:.1f})"
            if np.isfinite(row.get("psignifit_jnd", np.nan)):
                low, high = row["psignifit_low"], row["psignifit_high"]
                jnd += f", by psignifit {row['psignifit_jnd']:.1f} ({low:.1f} – {high:.1f})"
            jnd += " samples per pixel"
        end = f"; thesis about {beside:.0f}" if beside and of == ["scene"] else ""
        lines.append(f"{', '.join(str(row[name]) for name in of)}: JND {jnd}{end}")
    for row in tested.to_dict("records"):
        if not pd.isna(row["thesis_p"]):
            what = f"{row['first']} against {row['second']} at {row['samples']:.0f}"
            found = f"t({row['degrees']:.0f}) = {row['t']:.2f}, p = {row['p']:.2g}"
            lines.append(f"{what}: {found}; thesis p = {row['thesis_p']:.2g}")
    for row in pairs.to_dict("records"):
        what = f"{row['first']} against {row['second']}: differ most at {row['samples']:.0f}"
        found = f"t({row['degrees']:.0f}) = {row['t']:.2f}, p = {row['p']:.2g}"
        lines.append(f"{what}, {found}, times {row['levels']} levels {row['corrected_p']:.2g}")
    return "\n".join(lines)
