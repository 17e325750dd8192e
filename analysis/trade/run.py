"""Measures the trade and writes its tables, figures and page."""

from __future__ import annotations

from typing import Any

import pandas as pd

from analysis.command.cli import full_disk
from analysis.comparison.front import STORED
from analysis.page.figures import save
from analysis.storage.files import write_json, write_table
from analysis.storage.results import SUMMARY
from analysis.storage.summary import with_source
from analysis.study.evaluation import broken
from analysis.study.written import write_tables
from analysis.trade import plots
from analysis.trade.knobs import KNOBS, chosen_knobs
from analysis.trade.measuring import Measurements, measure
from analysis.trade.options import TradeOptions
from analysis.trade.page import write_page
from analysis.trade.shown import shown_tables
from analysis.trade.store import front_file
from analysis.trade.tables import Relative, knees, knob_table, lines, point_table, relative, sentences

Tables = dict[str, pd.DataFrame]


def trade(options: TradeOptions) -> tuple[dict[str, Any], Tables]:
    """Makes missing runs and writes everything to ``options.out``.

    Returns:
        The content of ``summary.json``, and the tables.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    measured = measure(options, chosen_knobs(options.knobs))
    measured.outcomes.tell()
    points = point_table(measured.results(), options.ledger)
    front = relative(points, options.draws)
    tables = {"knobs": knob_table(points, options.draws), "front": front.front, "knees": knees(points)}
    out = options.out.resolve()
    with full_disk(out):
        write_table(out / "trade.csv", points)
        write_tables(out, tables, shown_tables(tables))
        pictures = _figures(options, points, front, tables["knobs"])
        stored = front_file(points, options)
        for path in (out / "front.json", *([STORED] if options.store else [])) if stored else ():
            write_json(path, stored)
        summary = _summary(options, measured, tables)
        write_page(out / "report.html", summary, tables, points, pictures, measured.outcomes.place)
        write_json(out / SUMMARY, summary)
    return summary, tables


def _figures(options: TradeOptions, points: pd.DataFrame, front: Relative, knobs: pd.DataFrame) -> dict[str, str]:
    """Writes the figures. Returns the names of their files, by caption."""
    if not front.settings:
        return {}
    out = options.out.resolve()
    made = {"Cost and error of all settings over those of the default, and their front": "front.png"}
    save(plots.front(front, points), out / "front.png")
    for policy in dict.fromkeys(KNOBS[name].policy for name in knobs["knob"]):
        own = lines(knobs, [KNOBS[name].policy == policy for name in knobs["knob"]])
        made[f"Each knob of {policy} alone"] = f"knobs_{policy}.png"
        save(plots.knobs(own), out / f"knobs_{policy}.png")
    made["Every input separately"] = "inputs.png"
    save(plots.inputs(points), out / "inputs.png")
    return made


def _summary(options: TradeOptions, measured: Measurements, tables: Tables) -> dict[str, Any]:
    outcomes = measured.outcomes
    made = list(outcomes.summaries().values())
    found = {
        "runs": len(outcomes.keys),
        "runs_done": len(made),
        "ledger": options.ledger,
        "dropped": measured.dropped,
        "sentences": sentences(tables["knobs"]),
        "broken_invariants": broken(made),
        "tables": {name: table.to_dict("records") for name, table in tables.items()},
        "failures": outcomes.reasons,
        "machine": {name: sum(one["machine"][name] for one in made) for name in ("run_s", "reference_s", "jod_s")},
    }
    return with_source(found, options, outcomes.added, device="cpu", seeds=list(range(options.repetitions)))
