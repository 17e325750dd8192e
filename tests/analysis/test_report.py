"""The page needs nothing from outside, lets nothing from outside run, and shows what it was given."""

from __future__ import annotations

import base64
import io
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from analysis.report import Moment, Report, Table, flat, png_bytes, render, write_report

EVIL = "<script src='http://evil.example/x.js'>alert(1)</script>&amp;\"'"


class Page(HTMLParser):
    """Tags with their attributes, the text of each element, and embedded pictures."""

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


def picture(value: int) -> np.ndarray:
    pixels = np.zeros((3, 5, 3), np.uint8)
    pixels[1, 2] = (value, 7, 9)
    return pixels


def report(text: str = EVIL) -> Report:
    table = Table(text, (text, text), [(text, text)], text)
    return Report(
        text, [text, text], table, [(text, png_bytes(picture(1))), (text, png_bytes(picture(2)))],
        [Moment(0.5, {text: picture(3), "b": picture(4)})], [table], {text: {text: text, "in": {text: 3}}},
    )  # fmt: skip


def decoded(source: str) -> np.ndarray:
    kind, _, data = source.partition(",")
    assert kind == "data:image/png;base64"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data, validate=True))))


def test_the_page_is_self_contained() -> None:
    """No address and no element that could load or run anything."""
    text = render(report("plain"))
    assert "http:" not in text and "https:" not in text and not re.search(r"url\(|@import", text)
    page = Page(text)
    allowed = "html head meta title style body h1 h2 p table tr th td img div span b details summary code"
    assert {tag for tag, _ in page.tags} <= set(allowed.split())
    assert {name for _, attrs in page.tags for name in attrs} <= {"lang", "charset", "class", "alt", "src"}
    assert all(source.startswith("data:image/png;base64,") for source in page.sources)


def test_hostile_text_is_shown_and_not_run() -> None:
    """The same elements and attributes as with plain text, and the text comes back from them as it was."""
    hostile, plain = Page(render(report())), Page(render(report("plain")))
    assert [(tag, sorted(attrs)) for tag, attrs in hostile.tags] == [(tag, sorted(attrs)) for tag, attrs in plain.tags]
    assert hostile.sources == plain.sources
    for tag, count in (("title", 1), ("h1", 1), ("h2", 4), ("th", 4), ("td", 5), ("code", 1), ("p", 4)):
        assert hostile.texts[tag].count(EVIL) >= count, tag
    assert EVIL in hostile.texts["b"] and next(a["alt"] for t, a in hostile.tags if t == "img") == EVIL


@given(st.text(st.characters(blacklist_categories=("Cs", "Cc"))))
def test_any_text_survives(text: str) -> None:
    page = Page(render(Report(text, [text], Table("t", (text,), [(text,)]))))
    assert page.texts["title"] == page.texts["h1"] == page.texts["p"] == page.texts["td"] == [text]


def test_pictures_are_embedded_in_order() -> None:
    """The first figure, the strip, the other figures."""
    shown = [decoded(source) for source in Page(render(report("plain"))).sources]
    assert [image[1, 2, 0] for image in shown] == [1, 3, 4, 2]
    assert all(np.array_equal(image, picture(image[1, 2, 0])) for image in shown)


def test_without_pictures_there_is_no_strip() -> None:
    text = render(Report("t", [], Table("k", ("a", "b"), [])))
    assert "Moments" not in text and "<img" not in text


def test_rows_keep_their_cells_and_numbers_their_class() -> None:
    page = Page(render(Report("t", [], Table("k", ("a", "b", "c"), [("1", "2", "3"), ("4", "5", "6")], "below"))))
    assert page.texts["td"] == list("123456") and page.texts["th"] == list("abc") and page.texts["p"] == ["below"]
    assert [attrs.get("class") for tag, attrs in page.tags if tag == "td"] == [None, "n", "n"] * 2


def test_the_file_is_written_whole(tmp_path: Path) -> None:
    write_report(tmp_path / "a" / "r.html", report())
    assert (tmp_path / "a" / "r.html").read_text("utf-8") == render(report())
    with pytest.raises(AttributeError):
        write_report(tmp_path / "a" / "r.html", None)  # type: ignore[arg-type]
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["r.html"]


def test_flat() -> None:
    nested = {"a": 1, "b": {"c": 2, "d": {"e": (3, 4)}}, "f": {}, "g": None}
    assert flat(nested) == [("a", 1), ("b.c", 2), ("b.d.e", (3, 4)), ("g", None)]
