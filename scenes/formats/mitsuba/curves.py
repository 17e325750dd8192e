"""Files of curves of Mitsuba: control points and radii, a line each, and empty lines between curves.

Source: Mitsuba 3 documentation, shapes ``bsplinecurve`` and ``linearcurve``; Mitsuba 0.5 documentation, shape ``hair``.
Transforms of Mitsuba 3 move the points and leave the radii as they are (measured with 3.9).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from scenes.arithmetic import determinant, power, product
from scenes.canonical import Curves, SceneError
from scenes.canonical.values import Matrix
from scenes.formats.geometry.orientation import scales_evenly
from scenes.formats.mitsuba.properties import Properties
from scenes.formats.text.numbers import NUMBER_MAX
from scenes.formats.text.scene_files import SceneFiles

_BINARY = b"BINARY_HAIR"
_RADIUS = 0.025  # of hair, by default


def read_curves(content: bytes, where: str, basis: str, radius: float | None = None) -> Curves:
    """Round curves of a file.

    Args:
        content: content of the file.
        where: its name, for messages.
        basis: ``linear`` or ``bspline``.
        radius: radius of all curves, whose lines then have three numbers; None if each line has its own.

    Raises:
        SceneError: it has no curves, or lines of another length.
    """
    width, lines = (4 if radius is None else 3), content.decode("latin-1").splitlines()
    rows, counts = [], [0]
    for number, line in enumerate(lines):
        words = line.split()
        if words and not words[0].startswith("#"):
            rows.append(line)
            counts[-1] += 1
            if len(words) != width:
                raise SceneError(f"{where}:{number + 1}: expected {width} numbers, got {line.strip()[:40]!r}")
        elif counts[-1]:
            counts.append(0)
    try:
        found = np.array(" ".join(rows).split(), np.float64).reshape(-1, width)
    except ValueError:
        raise SceneError(f"{where}: expected numbers") from None
    least = 2 if basis == "linear" else 4
    kept = np.array([count for count in counts if count], np.int32)
    if not len(kept) or kept.min() < least:
        raise SceneError(f"{where}: expected curves of at least {least} points, separated by empty lines")
    radii = found[:, 3] if radius is None else np.full(len(found), radius)
    if not np.abs(found).max() <= NUMBER_MAX or not 0.0 <= radii.min() <= radii.max() <= NUMBER_MAX:
        raise SceneError(f"{where}: expected points within 1e30 and radii from 0 to 1e30")
    points, widths = found[:, :3].astype(np.float32), (2.0 * radii).astype(np.float32)
    return Curves(points, widths, kept, basis, source=where)  # type: ignore[arg-type]


def curves_of(
    properties: Properties, basis: str, files: SceneFiles, known: dict[tuple[object, ...], Curves]
) -> Curves | None:
    """The curves of a shape, whose file is read once; None for a missing or binary one, which is reported."""
    where, name, report = properties.where, properties.text("filename", ""), properties.report
    path = files.known(name, where, report, f"the curves {name!r}", "left out")
    radius = properties.number("radius", _RADIUS) if properties.node.get("type") == "hair" else None
    if path is None:
        return None
    if (path, basis, radius) not in known:
        content = files.read(path, where)
        if content.startswith(_BINARY):
            report.add(where, f"the curves {name!r}, which are not text")
            return None
        known[path, basis, radius] = read_curves(content, str(path), basis, radius)
    return known[path, basis, radius]


def sized(curves: Curves, keys: list[Matrix]) -> tuple[Curves, list[Matrix]]:
    """Curves and their transforms, which scale the widths as the points; unevenly scaled points are placed instead."""
    if len(keys) == 1 and not scales_evenly(keys[0][:3, :3]):
        placed = product(curves.points.astype(np.float64), keys[0][:3, :3].T) + keys[0][:3, 3]
        return dataclasses.replace(curves, points=placed.astype(np.float32)), [np.eye(4)]
    size = scale_of(keys[0])
    return curves if size == 1.0 else dataclasses.replace(curves, widths=curves.widths / np.float32(size)), keys


def scale_of(matrix: Matrix) -> float:
    """The factor by which a transform scales lengths on average."""
    return power(abs(determinant(matrix)), 1.0 / 3.0)


def curve_text(curves: Curves, scale: float) -> Iterator[bytes]:
    """The parts of a file of round curves, whose radii are multiplied."""
    begins = np.cumsum(curves.counts) - curves.counts
    rows = np.concatenate([curves.points, 0.5 * scale * curves.widths[:, None]], axis=1)
    for begin, count in zip(begins.tolist(), curves.counts.tolist(), strict=True):
        lines = (" ".join(f"{value:.9g}" for value in row) for row in rows[begin : begin + count].tolist())
        yield ("\n".join(lines) + "\n\n").encode()
