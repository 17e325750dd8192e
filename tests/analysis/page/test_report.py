"""The page needs nothing from outside, lets nothing from outside run, and shows what it was given."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import UndefinedError

import analysis
from analysis.page.comparer import SCRIPTS, Comparer, Panel, Step, read_comparer, source
from analysis.page.curves import Curve, Plot
from analysis.page.environment import environment
from analysis.page.pictures import ColorScale, picture_bytes
from analysis.page.report import STYLE, Report, Table, flat, render, write_report
from tests.analysis.builders import png_bytes

EVIL = "<script src='http://evil.example/x.js'>alert(1)</script>&amp;\"'"


class Page(HTMLParser):
    """Tags with their attributes, and the text of each element."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.tags.append((tag, dict(attrs)))
        self._open.append(tag)
        self.texts.setdefault(tag, []).append("")

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self._open:
            self.texts[self._open[-1]][-1] += data

    @property
    def sources(self) -> list[str]:
        return [attrs["src"] or "" for tag, attrs in self.tags if tag == "img"]


def picture(value: int) -> bytes:
    return png_bytes(np.full((3, 5, 3), value, np.uint8))


def comparer(text: str) -> Comparer:
    scale = ColorScale.of((1.0, 100.0), text, "inferno", meaning=text)
    panels = [Panel("reference"), Panel(text, truth="reference"), Panel("map", scale=scale)]
    steps = [Step(0.1 * i, {"reference": picture(9), text: picture(i), "map": None}) for i in range(2)]
    plots = [Plot(text, text, [Curve(text, [0.0, 0.1], [1e-3, float("nan")], 0)], level=1.0, marks_s=[0.05])]
    return Comparer(panels, steps, "reference", text, plots, text)


def report(text: str = EVIL, compared: bool = True) -> Report:
    table = Table(text, (text, text), [(text, text)], text)
    return Report(
        text, [text, text], table, [(text, picture(1))], comparer(text) if compared else None, [table],
        {text: {text: text, "in": {text: 3}}},
    )  # fmt: skip


@pytest.mark.parametrize("compared", [True, False])
def test_the_page_is_self_contained(compared: bool) -> None:
    """No address and no element that could load anything; nothing runs but the script of the page."""
    text = render(report("plain", compared))
    code = "\n".join(path.read_text("utf-8") for path in SCRIPTS) + STYLE.read_text("utf-8")
    assert "http:" not in text and "https:" not in text
    assert not re.search(r"url\(|@import|fetch|XMLHttp|eval\(|innerHTML", code)
    page = Page(text)
    assert not {"link", "iframe", "object", "embed", "form", "base", "a"} & {tag for tag, _ in page.tags}
    assert not [name for _, attrs in page.tags for name in attrs if name.startswith("on") or name in ("href", "srcset")]
    assert all(one.startswith("data:image/png;base64,") for one in page.sources)
    scripts = [attrs.get("id") for tag, attrs in page.tags if tag == "script"]
    assert scripts == (["comparer-data", "picture-0", "picture-1", "picture-2", None] if compared else [])


@pytest.mark.parametrize("compared", [True, False])
def test_the_policy_of_the_page_allows_nothing_else(compared: bool) -> None:
    page = Page(render(report("plain", compared)))
    policy = next(a["content"] for _, a in page.tags if a.get("http-equiv") == "Content-Security-Policy") or ""
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == rules["base-uri"] == "'none'" and rules["img-src"] == "data:"
    run = page.texts["script"][-1] if compared else ""
    digest = base64.b64encode(hashlib.sha256(run.encode()).digest()).decode()
    assert rules["script-src"] == (f"'sha256-{digest}'" if compared else "'none'")


def test_hostile_text_is_shown_and_not_run() -> None:
    """The same elements and attributes as with plain text, and the text comes back from them as it was."""
    hostile, plain = Page(render(report())), Page(render(report("plain")))
    assert [(tag, sorted(attrs)) for tag, attrs in hostile.tags] == [(tag, sorted(attrs)) for tag, attrs in plain.tags]
    for tag, count in (("title", 1), ("h1", 1), ("h2", 3), ("th", 5), ("td", 2), ("code", 1), ("option", 2), ("p", 2)):
        assert hostile.texts[tag].count(EVIL) >= count, tag
    data, script = hostile.texts["script"][0], hostile.texts["script"][-1]
    assert "<" not in data and script == plain.texts["script"][-1]
    assert json.loads(data)["panels"][1]["label"] == EVIL


@given(st.text(st.characters(blacklist_categories=("Cs", "Cc"))))
def test_any_text_survives(text: str) -> None:
    page = Page(render(Report(text, [text], Table("t", ("x",), [(text,)]))))
    assert page.texts["title"] == page.texts["h1"] == page.texts["p"] == [text] and text in page.texts["th"]


def test_equal_pictures_are_stored_once() -> None:
    given, files = comparer("plain").stored()
    assert files == [picture(9), picture(0), picture(1)]
    assert [step["pictures"] for step in given["steps"]] == [[0, 1, None], [0, 2, None]]


def test_a_comparer_is_read_back(tmp_path: Path) -> None:
    made = comparer(EVIL)
    write_report(tmp_path / "r.html", report())
    found = read_comparer(tmp_path / "r.html")
    assert found.steps == made.steps and found.panels == made.panels and found.note == made.note
    assert (found.left, found.right, found.span_s) == (made.left, made.right, made.span_s)
    assert repr(found.plots) == repr(made.plots)
    write_report(tmp_path / "r.html", report(compared=False))
    with pytest.raises(ValueError, match=r"r\.html: expected a page with pictures to compare"):
        read_comparer(tmp_path / "r.html")


def test_the_kind_of_a_picture_is_named() -> None:
    pixels = np.zeros((8, 8, 3), np.uint8)
    kinds = {"png": png_bytes(pixels), "webp": picture_bytes(pixels, True), "avif": picture_bytes(pixels, False)}
    assert all(source(data).startswith(f"data:image/{kind};base64,") for kind, data in kinds.items())


def test_a_comparer_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one step"):
        Comparer([Panel("a")], [], "a", "a")
    with pytest.raises(ValueError, match="expected one of a, got 'b'"):
        Comparer([Panel("a")], [Step(0.0, {})], "a", "b")


def test_without_a_comparer_there_is_no_script() -> None:
    text = render(Report("t", [], Table("k", ("a", "b"), [])))
    assert "<script" not in text and "<img" not in text and 'id="slider"' not in text


def test_rows_keep_their_cells_and_numbers_their_class() -> None:
    page = Page(render(Report("t", [], Table("k", ("a", "b", "c"), [("1", "2", "3"), ("4", "5", "6")], "below"))))
    assert page.texts["td"] == list("2356") and page.texts["th"] == list("abc14") and page.texts["caption"] == ["below"]
    assert [attrs.get("class") for tag, attrs in page.tags if tag == "td"] == ["n"] * 4
    assert [attrs.get("scope") for tag, attrs in page.tags if tag == "th"] == ["col"] * 3 + ["row"] * 2


def test_the_file_is_written_whole(tmp_path: Path) -> None:
    write_report(tmp_path / "a" / "r.html", report())
    assert (tmp_path / "a" / "r.html").read_text("utf-8") == render(report())
    with pytest.raises(AttributeError):
        write_report(tmp_path / "a" / "r.html", None)  # type: ignore[arg-type]
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["r.html"]


def test_flat() -> None:
    nested = {"a": 1, "b": {"c": 2, "d": {"e": (3, 4)}}, "f": {}, "g": None}
    assert flat(nested) == [("a", 1), ("b.c", 2), ("b.d.e", (3, 4)), ("g", None)]


def test_every_page_is_a_template_of_one_environment() -> None:
    """Names that are not given, and text that is not escaped, are faults there."""
    assert not list(Path(analysis.__file__).parent.rglob("*.html"))
    assert {"report.html.j2", "live.html.j2", "trial.html.j2"} <= set(environment().list_templates())
    page = environment().get_template("trial.html.j2")
    assert EVIL not in page.render(token=EVIL)
    with pytest.raises(UndefinedError):
        page.render()
