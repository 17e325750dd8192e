"""Tables of trials from any source: every column that is read is checked, and converted where its meaning is clear."""

from __future__ import annotations

import codecs
import csv
import io
import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.command.cli import InputError

CONDITIONS = ("scene", "point_set", "time_filter")
"""Columns in which trials differ besides the level."""

REQUIRED = ("observer", "samples", "correct")
"""Columns that every table of trials has."""

_USUAL = {"observer_kind": "unknown", **dict.fromkeys(CONDITIONS, "all")}
"""Values of columns that a table may lack."""

_TEXTS = ("observer_kind", "observer", *CONDITIONS)
_NOTHING = ("", "NA", "N/A", "NaN", "nan", "null", "NULL", "None", "<NA>")
_SEPARATOR = re.compile(r"\s*sep=(.)[ \t]*\n")  # as Excel writes it
_RIGHT = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}
_UNFIT = ("false", "0", "0.0")
_SIDES = ("left", "right")


def read_trials(paths: Sequence[Path]) -> tuple[pd.DataFrame, str]:
    """The answered trials of all tables, and the kind of their observers.

    Args:
        paths: files, read as CSV where their names end in ``.csv``, else as Parquet. CSV may have commas, semicolons
            or tabs between values, in any usual encoding; case and blanks of the names of columns do not matter.

    Raises:
        InputError: a file cannot be read, as :func:`checked_trials`, or the kinds of two files differ.
    """
    tables, kinds, seen = [], dict[str, Path](), set[Path]()
    for path in paths:
        if path.resolve() in seen:
            raise InputError(f"trials: expected different tables, got {path} twice")
        seen.add(path.resolve())
        comma = path.suffix.lower() == ".csv"
        try:
            table = _csv(path.read_bytes()) if comma else pd.read_parquet(path)
        except (OSError, ValueError, csv.Error) as error:
            reason = " ".join(str(error).split())
            raise InputError(f"trials: {path}: cannot be read as {'CSV' if comma else 'Parquet'} ({reason})") from None
        trials, kind = checked_trials(table, str(path))
        tables.append(trials)
        kinds.setdefault(kind, path)
    if len(kinds) > 1:
        found = ", ".join(f"{kind} in {path}" for kind, path in kinds.items())
        raise InputError(f"trials: expected observers of one kind, got {found}")
    return pd.concat(tables, ignore_index=True), next(iter(kinds))


def _csv(content: bytes) -> pd.DataFrame:
    """A table whose separator is that of its first line; numbers with commas go with semicolons, as spreadsheets write
    them.

    Raises:
        ValueError: it is no table, or two of its columns differ in case and blanks alone.
    """
    wide = content[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    try:
        text = content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
    text = "\n".join(text.splitlines())
    said, text = _SEPARATOR.match(text), _SEPARATOR.sub("", text, count=1).lstrip()
    head = text.partition("\n")[0]
    outside = re.sub(r'"[^"]*"', "", head)
    between = said[1] if said else max(",;\t", key=outside.count)
    # separators at the ends of lines would be an index; what they leave out is empty anyway
    text = re.sub(rf"[ {between}]+$", "", text, flags=re.MULTILINE)
    names = next(csv.reader([head.rstrip()], delimiter=between, skipinitialspace=True), [])
    plain = [name.strip().lower() for name in names if name.strip()]
    twice = next((name for number, name in enumerate(plain) if name in plain[:number]), None)
    if twice is not None:
        raise ValueError(f"two columns {twice}")
    texts = [name for name in names if name.strip().lower() in _TEXTS]  # 007 is not 7, and NA may be a name
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)
        try:
            table = pd.read_csv(
                io.StringIO(text),
                sep=between,
                decimal="," if between == ";" else ".",
                skipinitialspace=True,
                index_col=False,
                dtype=dict.fromkeys(texts, str),
                keep_default_na=False,
                na_values={name: [""] if name in texts else [*_NOTHING] for name in names},
            )
        except pd.errors.ParserWarning:
            raise ValueError("rows have more values than there are columns") from None
    return table.rename(columns=lambda name: str(name).strip().lower())


def undisturbed(trials: pd.DataFrame) -> pd.DataFrame:
    """The trials that fit the window and dropped no frame, as far as their table says."""
    kept = np.ones(len(trials), bool)
    if "fits_window" in trials:
        kept &= ~trials["fits_window"].astype(str).str.strip().str.lower().isin(_UNFIT).to_numpy()
    if "dropped_frames" in trials:
        kept &= ~(np.asarray(pd.to_numeric(trials["dropped_frames"], errors="coerce"), np.float64) > 0)
    return trials.loc[kept]


def checked_trials(table: pd.DataFrame, name: str) -> tuple[pd.DataFrame, str]:
    """The trials that have an answer, and the kind of their observers.

    Args:
        table: table from a file; trials without ``correct`` have no answer.
        name: name of the file, for messages.

    Returns:
        Trials with ``correct`` as booleans, ``samples`` as integers, names as text.

    Raises:
        InputError: a column is missing or has an invalid value, kinds are mixed, or there is no answer.
    """
    missing = [column for column in REQUIRED if column not in table.columns]
    if missing:
        raise InputError(f"{name}: expected a table of trials, found no column {', '.join(missing)}")
    table = table.assign(**{column: value for column, value in _USUAL.items() if column not in table.columns})
    answered = table.loc[table["correct"].notna()]
    if answered.empty:
        raise InputError(f"{name}: expected answered trials, got none")
    correct, samples = (_converted(answered, *column, name) for column in (_CORRECT, _SAMPLES))
    names = {
        column: _converted(answered, column, *_NAME, name) for column in ("observer_kind", "observer", *CONDITIONS)
    }
    found = answered.assign(**names, correct=correct, samples=samples)
    kinds = sorted(set(found["observer_kind"]))
    if len(kinds) != 1:
        raise InputError(f"{name}: expected observers of one kind, got {', '.join(kinds)}")
    _check_sides(found, name)
    return found, kinds[0]


def _converted(table: pd.DataFrame, column: str, convert: Any, expected: str, name: str) -> list[Any]:
    found = []
    for number, value in zip(table.index, table[column], strict=True):
        try:
            found.append(convert(value))
        except (ValueError, KeyError, TypeError, OverflowError):
            raise InputError(
                f"{name}: column {column}, row {number}: expected {expected}, got {str(value)[:40]!r}"
            ) from None
    return found


def _as_right(value: Any) -> bool:
    """Whether an answer was right, from a boolean, 0 or 1, or text such as yes or no."""
    if isinstance(value, str):
        return _RIGHT[value.strip().lower()]
    if value not in (0, 1):
        raise ValueError
    return bool(value)


def _as_level(value: Any) -> int:
    number = float(value)
    if isinstance(value, (bool, np.bool_)) or not 1.0 <= number <= 2.0**31 or number != int(number):
        raise ValueError
    return int(number)


def _as_name(value: Any) -> str:
    """A name that is also valid as a file name."""
    if isinstance(value, (int, np.integer)):
        return str(value)
    if not isinstance(value, str) or not value.strip() or value.startswith(".") or any(c in value for c in "/\\\0"):
        raise ValueError
    return value


_CORRECT = "correct", _as_right, "right or wrong (true or false, 1 or 0, yes or no)"
_SAMPLES = "samples", _as_level, "a whole number of samples of at least 1"
_NAME = _as_name, "a name without slashes that does not begin with a dot"


def _check_sides(trials: pd.DataFrame, name: str) -> None:
    """Checks that ``correct`` agrees with the sides, if both are given.

    Raises:
        InputError: a trial contradicts its sides.
    """
    if not {"answer", "differing_side"} <= set(trials.columns):
        return
    given = trials["answer"].isin(_SIDES) & trials["differing_side"].isin(_SIDES)
    wrong = np.flatnonzero(given & ((trials["answer"] == trials["differing_side"]) != trials["correct"]))
    if len(wrong):
        row = trials.iloc[wrong[0]]
        raise InputError(
            f"{name}: column correct, row {trials.index[wrong[0]]}: expected {row['answer'] == row['differing_side']} "
            f"for the answer {row['answer']} where {row['differing_side']} differs, got {bool(row['correct'])}"
        )
