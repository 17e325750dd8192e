"""The page needs nothing from outside, lets nothing from outside run, and shows what it was given."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from analysis.page.player import SCRIPT, Curve, Player, Step
from analysis.page.report import Report, Table, flat, render, write_report
from tests.analysis.builders import png_bytes

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


def player(text: str) -> Player:
    pictures = [{text: png_bytes(picture(3 + 2 * i)), "b": png_bytes(picture(4 + 2 * i))} for i in range(2)]
    return Player(
        np.array([0.0, 0.1, 0.2]), [Step(0, pictures[0]), Step(2, pictures[1])],
        [Curve(text, "#123456", [1e-3, 1e-2, 1e-1])], text, [0.1], {text: [text] * 3}, text,
    )  # fmt: skip


def report(text: str = EVIL, played: bool = True) -> Report:
    table = Table(text, (text, text), [(text, text)], text)
    return Report(
        text, [text, text], table, [(text, png_bytes(picture(1))), (text, png_bytes(picture(2)))],
        player(text) if played else None, [table], {text: {text: text, "in": {text: 3}}},
    )  # fmt: skip


def decoded(source: str) -> np.ndarray:
    kind, _, data = source.partition(",")
    assert kind == "data:image/png;base64"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data, validate=True))))


TAGS = "html head meta title style body h1 h2 p table tr th td img div span b details summary code"
ATTRIBUTES = "lang charset name content http-equiv class alt src"
PLAYER_TAGS = "figure figcaption noscript button input script svg g line path circle text"
PLAYER_ATTRIBUTES = """id type min max step value autocomplete hidden style role aria-label
viewbox transform x y x1 x2 y1 y2 cx cy r d dy fill stroke text-anchor visibility"""


@pytest.mark.parametrize("played", [True, False])
def test_the_page_is_self_contained(played: bool) -> None:
    """No address and no element that could load anything; nothing runs but the script of the page."""
    text = render(report("plain", played))
    assert "http:" not in text and "https:" not in text and "//" not in text.replace("// ", "")
    assert not re.search(r"url\(|@import|\bon\w+=|fetch|XMLHttp|eval\(|innerHTML", text)
    page = Page(text)
    assert {tag for tag, _ in page.tags} <= set((TAGS + " " + PLAYER_TAGS * played).split())
    attributes = {name for _, attrs in page.tags for name in attrs}
    assert attributes <= set((ATTRIBUTES + " " + PLAYER_ATTRIBUTES * played).split())
    assert all(source.startswith("data:image/png;base64,") for source in page.sources)
    scripts = [attrs for tag, attrs in page.tags if tag == "script"]
    assert scripts == ([{"type": "application/json", "id": "player-data"}, {}] if played else [])
    assert page.texts.get("script", [])[1:] == ([SCRIPT.read_text("utf-8")] if played else [])


@pytest.mark.parametrize("played", [True, False])
def test_the_policy_of_the_page_allows_nothing_else(played: bool) -> None:
    page = Page(render(report("plain", played)))
    policy = next(a["content"] for _, a in page.tags if a.get("http-equiv") == "Content-Security-Policy") or ""
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == rules["base-uri"] == "'none'" and rules["img-src"] == "data:"
    digest = base64.b64encode(hashlib.sha256(SCRIPT.read_bytes()).digest()).decode()
    assert rules["script-src"] == (f"'sha256-{digest}'" if played else "'none'")


def test_hostile_text_is_shown_and_not_run() -> None:
    """The same elements and attributes as with plain text, and the text comes back from them as it was."""
    hostile, plain = Page(render(report())), Page(render(report("plain")))
    assert [(tag, sorted(attrs)) for tag, attrs in hostile.tags] == [(tag, sorted(attrs)) for tag, attrs in plain.tags]
    assert hostile.sources == plain.sources
    for tag, count in (("title", 1), ("h1", 1), ("h2", 4), ("th", 4), ("td", 6), ("code", 1), ("p", 5)):
        assert hostile.texts[tag].count(EVIL) >= count, tag
    assert EVIL in hostile.texts["b"] and EVIL in hostile.texts["figcaption"] and EVIL in hostile.texts["span"]
    assert next(attrs["alt"] for tag, attrs in hostile.tags if tag == "img") == f"{EVIL} at 0.000 s"
    block, script = hostile.texts["script"]
    assert "<" not in block and script == plain.texts["script"][1]
    given = json.loads(block)
    assert given["labels"] == [EVIL, "b"] and given["steps"][1]["values"] == ["1.00e-01", EVIL]


@given(st.text(st.characters(blacklist_categories=("Cs", "Cc"))))
def test_any_text_survives(text: str) -> None:
    page = Page(render(Report(text, [text], Table("t", (text,), [(text,)]))))
    assert page.texts["title"] == page.texts["h1"] == page.texts["p"] == page.texts["td"] == [text]


def test_pictures_are_embedded_in_order() -> None:
    """The first step of the player, then the figures; the other steps lie in the data."""
    page = Page(render(report("plain")))
    shown = [decoded(source) for source in page.sources]
    assert [image[1, 2, 0] for image in shown] == [3, 4, 1, 2]
    assert all(np.array_equal(image, picture(image[1, 2, 0])) for image in shown)
    steps = [step["pictures"] for step in json.loads(page.texts["script"][0])["steps"]]
    assert steps[0] == page.sources[:2] and [decoded(source)[1, 2, 0] for source in steps[1]] == [5, 6]


def test_without_a_player_there_is_no_script() -> None:
    text = render(Report("t", [], Table("k", ("a", "b"), [])))
    assert "<script" not in text and "<img" not in text and "slider" not in text


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
