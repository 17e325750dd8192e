"""The trade as a page on which every point shows its setting and its picture."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from PIL import Image

from analysis.page.explorer import Explorer, PlotPoint
from analysis.page.figures import ADAPTIVE, FRAMED, OTHER
from analysis.page.report import Report, write_report
from analysis.study.evaluation import Resources
from analysis.trade.knobs import OWN
from analysis.trade.runs import SEARCH
from analysis.trade.shown import shown_tables
from analysis.trade.tables import lines

Tables = Mapping[str, pd.DataFrame]

_QUANTITIES = {
    "FLOPs": "cost_flops",
    "wall seconds": "wall_s",
    "memory, bytes": "peak_bytes",
    "latency, s": "latency_s",
    "rays": "rays",
    "MSE": "mse",
    "FLIP": "flip",
    "JOD": "jod",
}
_ERRORS = 3
_ALONE, _SEARCHED, _OTHERS = "a knob of tsar alone", "the search", "another policy"


def write_page(
    path: Path, summary: Mapping[str, Any], tables: Tables, points: pd.DataFrame, figures: Mapping[str, str],
    place: Resources,
) -> None:  # fmt: skip
    """Writes ``report.html``.

    Args:
        path: path of the page; figures lie beside it.
        summary: content of ``summary.json``.
        tables: tables of the trade.
        points: all points.
        figures: names of files, by caption.
        place: folder of the results with their pictures.
    """
    config, shown = summary["config"], shown_tables(tables)
    lead = [
        f"{summary['runs_done']} of {summary['runs']} runs at scale {config['scale']}, cost by the ledger "
        f"{summary['ledger']}, {config['repetitions']} repetitions, each with its seed and, where the input has "
        "phases, its phase. All policies sample 50 batches of their framelets a second; cost is what they "
        "spend.",
        "A setting is on the front if no other has both less cost and less error. The knee is the point of the "
        "front that lies farthest below the line between its ends, on logarithmic axes.",
    ]
    if summary["failures"]:
        lead.append(f"Failed: {'; '.join(f'{name}: {reason}' for name, reason in summary['failures'].items())}")
    report = Report(
        title="The trade of speed for accuracy",
        lead=lead,
        key_numbers=shown[0] if shown else None,
        explorer=_explorer(points, place) if len(points) else None,
        figures=[(caption, (path.parent / file).read_bytes()) for caption, file in figures.items()],
        tables=shown[1:],
        details={"Configuration": config, "Provenance": summary["provenance"]},
    )
    write_report(path, report)


def _explorer(points: pd.DataFrame, place: Resources) -> Explorer:
    """The points of the first seed, with each setting once."""
    own = lines(points, points["seed"] == points["seed"].min()).drop_duplicates(["input", "setting"])
    found, pictures, truths = list[PlotPoint](), dict[str, bytes](), dict[str, str]()
    for line in own.to_dict("records"):
        key, group = line["result"], Path(line["input"]).name
        if place.still(key, "shown", 0).is_file():
            pictures[key] = _webp(place.still(key, "shown", 0))
        if group not in truths and place.still(key, "reference", 0).is_file():
            truths[group] = f"reference of {group}"
            pictures[truths[group]] = _webp(place.still(key, "reference", 0))
        values = {name: float(line[column]) for name, column in _QUANTITIES.items()}
        kind = _SEARCHED if line["knob"] == SEARCH else _OTHERS if line["policy"] != OWN else _ALONE
        found.append(PlotPoint(group, kind, line["setting"], values, key))
    names = list(_QUANTITIES)
    return Explorer(
        points=found,
        across=names[:-_ERRORS],
        upward=names[-_ERRORS:],
        colours={_ALONE: OTHER, _SEARCHED: ADAPTIVE, _OTHERS: FRAMED},
        pictures=pictures,
        truths=truths,
        note="The line is the front of the drawn points. Pictures are of the middle of the run. Memory is what the run "
        "took on top of what its process held before.",
    )


def _webp(path: Path) -> bytes:
    made = io.BytesIO()
    Image.open(path).save(made, "webp", quality=80)
    return made.getvalue()
