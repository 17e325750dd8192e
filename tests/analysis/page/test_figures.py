"""Figures of all commands: vector beside raster, the inks of Okabe and Ito, and marks that differ in grey, too."""

from __future__ import annotations

import ast
import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image, ImageColor

from analysis.comparison.plots import stage_figure
from analysis.page.figures import (
    DASHES,
    INKS,
    MARKERS,
    dashes_of,
    ink_of,
    label_ends,
    label_points,
    line_style,
    new_figure,
    save,
    styles,
)

ROOT = Path(__file__).resolve().parents[3] / "analysis"
SHARED = "page/figures.py"
RASTER_ONLY = {
    SHARED: "save writes both",
    "comparison/results.py": "the bytes of a picture within a page",
    "tracer/gallery.py": "a sheet of pictures",
}
"""Files that write a figure by matplotlib itself, and why."""
LINES = {"plot", "step", "semilogx", "semilogy", "loglog", "errorbar", "fill_between", "axhline", "axvline", "bar"}


def modules() -> Iterator[tuple[str, ast.Module]]:
    """Every module that draws by matplotlib or pyvista."""
    for file in sorted(ROOT.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if "matplotlib" in text or "pyvista" in text:
            yield file.relative_to(ROOT).as_posix(), ast.parse(text)


def calls(tree: ast.AST) -> Iterator[tuple[str, ast.Call]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            yield node.func.attr, node


def test_every_figure_is_written_as_vector_too() -> None:
    """By :func:`save`, but for those that are named above; pictures of pyvista by its own way."""
    found = {name for name, tree in modules() if any(called == "savefig" for called, _ in calls(tree))}
    assert found == set(RASTER_ONLY)
    drawn = 0
    for name, tree in modules():
        for part in ast.walk(tree):
            if isinstance(part, ast.FunctionDef):
                called = {one for one, _ in calls(part)}
                drawn += "screenshot" in called
                assert ("screenshot" in called) == ("save_graphic" in called), f"{name}: {part.name}"
    assert drawn == 1


def test_inks_are_of_one_place() -> None:
    found = []
    for name, tree in modules():
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("#"):
                found += [f"{name}:{node.lineno}"] * (len(node.value) == 7 and name != SHARED)
    assert not found


def test_no_line_has_the_ink_of_a_map() -> None:
    """A colour map is of pictures: a line that takes its ink there is none of those that all can tell apart."""
    found = [name for name, tree in modules() for node in ast.walk(tree)
             if isinstance(node, ast.Attribute) and node.attr == "colormaps"]  # fmt: skip
    assert set(found) == {"page/pictures.py", "spectrum/plots.py"}


def test_no_legend_lies_within_the_axes_of_bars() -> None:
    """A bar may be as high as its axes."""
    drawn = stage_figure({"tracing": 4.0, "all others": 96.0}, {"tracing": 96.0, "all others": 4.0})
    assert [text.get_text() for text in drawn.legends[0].get_texts()] == ["modelled operations", "measured seconds"]
    assert drawn.axes[0].get_legend() is None
    assert len({bar.get_hatch() for bars in drawn.axes[0].containers for bar in bars.patches}) == 2  # type: ignore[attr-defined]


def test_no_line_has_the_ink_of_a_cycle() -> None:
    found = []
    for name, tree in modules():
        for called, node in calls(tree):
            named = {one.arg for one in node.keywords}
            letters = [one.value for one in node.args if isinstance(one, ast.Constant) and isinstance(one.value, str)]
            known = named & {"color", "facecolor", "markeredgecolor", None} or any("k" in one for one in letters)
            found += [f"{name}:{node.lineno} {ast.unparse(node)[:60]}"] * (called in LINES and not known)
    assert not found


def test_inks_dashes_and_marks_differ_in_grey() -> None:
    """Neighbouring lines differ in dashes, and points in marks, whatever grey their inks become."""
    assert len(set(INKS)) == len(set(DASHES)) == len(set(MARKERS)) == len(INKS)
    assert all(max(ImageColor.getrgb(ink)) - min(ImageColor.getrgb(ink)) > 60 for ink in INKS if ink != "#000000")


def test_many_rivals_have_a_style_each() -> None:
    """Their inks repeat, with other dashes."""
    many = [(ink_of(style), dashes_of(style)) for style in styles([str(n) for n in range(37)], "0").values()]
    assert len(set(many)) == 37 and [ink for ink, _ in many].count(0) == 1
    assert len({dashes for _, dashes in many[:7]}) == len({ink for ink, _ in many[:7]}) == 7


@pytest.fixture
def figure() -> Figure:
    drawn, (axis,) = new_figure(4.0, 3.0)
    for style, name in enumerate(("one", "two", "three")):
        axis.plot([0.0, 1.0], [style, 2.0], label=name, **line_style(style))
    label_ends(axis)
    return drawn


def test_a_figure_is_saved_twice_with_the_same_bytes(figure: Figure, tmp_path: Path) -> None:
    save(figure, tmp_path / "a" / "f.png")
    save(figure, tmp_path / "b" / "f.png")
    for ending in ("png", "svg"):
        first, second = ((tmp_path / name / f"f.{ending}").read_bytes() for name in "ab")
        assert first == second and len(first) > 1000
    text = (tmp_path / "a" / "f.svg").read_bytes()
    assert b"<svg" in text and b"\r" not in text and b"<image" not in text
    with Image.open(tmp_path / "a" / "f.png") as picture:
        assert picture.size == (520, 390)


def test_every_line_has_its_label_where_it_ends() -> None:
    """At the scales that are drawn, which matplotlib finds last, after a piece of the line with its dashes and mark."""
    drawn, (axis,) = new_figure(4.0, 3.0)
    ends = {"one": 1e-2, "two": 1.0, "three": 1e2}
    for (style, (name, end)), mark in zip(enumerate(ends.items()), MARKERS, strict=False):
        axis.loglog([1.0, 9.0], [1.0, end], mark, label=name, **line_style(style))
    lines = list(axis.lines)
    label_ends(axis)
    drawn.canvas.draw()
    heights = {text.get_text(): axis.transAxes.transform(text.xy)[1] for text in axis.texts}
    assert heights == pytest.approx(
        {name: axis.transData.transform((9.0, end))[1] for name, end in ends.items()}, abs=1
    )
    for line, lead in zip(lines, axis.lines[3:], strict=True):
        assert lead.get_transform().transform(lead.get_xydata())[0, 0] > axis.bbox.x1
        assert (lead.get_marker(), lead._dash_pattern) == (line.get_marker(), line._dash_pattern)


def test_labels_of_close_points_do_not_overlap() -> None:
    """Each has a line to its point; points that lie apart have their label beside them."""
    drawn, (axis,) = new_figure(4.0, 3.0)
    places = [(1.0, 1.0 + 0.001 * n) for n in range(8)] + [(50.0, 2.0)]
    axis.loglog(*zip(*places, strict=True), "o", color=INKS[0])
    axis.set(xlim=(0.5, 200.0), ylim=(0.5, 4.0))
    label_points(axis, places, [f"number {n}" for n in range(9)], 7.0, "number 3")
    drawn.draw_without_rendering()
    assert [text.get_fontweight() for text in axis.texts].count("bold") == 1
    texts = sorted(Text.get_window_extent(text).extents.tolist() for text in axis.texts)
    assert all(a[3] <= b[1] or b[3] <= a[1] or a[2] <= b[0] for a, b in itertools.combinations(texts, 2))
    for text, place in zip(axis.texts, places, strict=True):
        assert tuple(text.xy) == place and text.arrow_patch is not None
    apart = Text.get_window_extent(axis.texts[8])
    assert apart.y0 < axis.transData.transform(places[8])[1] < apart.y1
