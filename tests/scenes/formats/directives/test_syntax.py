"""The text of PBRT-like files: valid text, and the place of errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import SceneError
from scenes.formats.directives.syntax import parameters_of, parse_directives
from scenes.formats.text.places import TextPosition


def no_files(name: str, place: TextPosition, inside: tuple[Path, ...]) -> tuple[str, Path]:
    raise SceneError(f"{place}: no files, got {name}")


def only(text: str):
    (directive,) = parse_directives(text, Path("a.pbrt"), no_files)
    return directive


def test_numbers_with_and_without_brackets_comments_and_exponents() -> None:
    directive = only('Shape "x" "point P" [ 1 -2.5e-3 # one\n .5\n1.9e-015 -0 ] "float r" 3. "integer n" [7]')
    parameters = parameters_of(directive, 1)
    np.testing.assert_array_equal(parameters.numbers("P"), [1.0, -2.5e-3, 0.5, 1.9e-15, -0.0])
    assert parameters.number("r", 0.0) == 3.0 and parameters.whole("n", 0, 0, 9) == 7
    assert parameters.unasked() == []


def test_strings_and_truths() -> None:
    parameters = parameters_of(
        only('Film "image" "string filename" "a b.png" "bool on" [ "true" ] "bool off" false'), 1
    )
    assert parameters.text("filename", "") == "a b.png"
    assert parameters.truth("on", False) and not parameters.truth("off", True)
    assert parameters.truth("none", True)


def test_what_is_not_asked_for_is_told() -> None:
    parameters = parameters_of(only('Camera "perspective" "float fov" 40 "float strange" 1'), 1)
    parameters.number("fov", 0.0)
    assert parameters.unasked() == ["strange"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('Film "image"\n  "string filename" ["a', r"a.pbrt:2:21: expected a directive"),
        ("\n\n  [1 2]", r"a.pbrt:3:3: expected a directive"),
        ('Shape "x" "float r" [ 1 2e 3 ]', r"a.pbrt:1:21: expected numbers"),
        ('Shape "x" "float r" [ 1e308 ]', r"a.pbrt:1:21: expected numbers up to 1e\+30"),
        ('Shape "x" "float r" 1e999', r"a.pbrt:1:21: expected numbers up to"),
        ("Shape 'x'", r"a.pbrt:1:7: expected a directive, string or number"),
    ],
)
def test_faults_of_text_have_their_place(text: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        list(parse_directives(text, Path("a.pbrt"), no_files))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('Shape "x" "float"', "expected a parameter such as"),
        ('Shape "x" "float r"', "expected a value for 'r'"),
        ('Shape "x" 3 4', "expected a parameter such as"),
    ],
)
def test_faults_of_parameters(text: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        parameters_of(only(text), 1)


@pytest.mark.parametrize(
    ("value", "ask", "message"),
    [
        ('"float r" [1 2]', lambda p: p.number("r", 0.0), "expected 1 numbers, got 2"),
        ('"float r" "a"', lambda p: p.number("r", 0.0), "expected numbers, got ..a"),
        ('"integer r" 1.5', lambda p: p.whole("r", 0, 0, 9), "expected a whole number from 0 to 9, got 1.5"),
        ('"string r" 1', lambda p: p.text("r", ""), "expected one string"),
        ('"bool r" "maybe"', lambda p: p.truth("r", True), "expected true or false, got 'maybe'"),
    ],
)
def test_values_of_another_kind(value: str, ask, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        ask(parameters_of(only(f'Shape "x" {value}'), 1))


def test_a_list_of_a_million_numbers_is_one_token() -> None:
    directive = only(f'Shape "x" "point P" [ {"0.125 " * 1_000_000}]')
    assert len(directive.values) == 3 and len(directive.values[2]) == 1_000_000
