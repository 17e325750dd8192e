"""The help of every command: boxes of at most ten options, and no name of an option with two meanings."""

from __future__ import annotations

import importlib
import itertools
import re
import sys
from collections import defaultdict
from typing import Any, get_args

import pytest

from analysis.command import cli
from analysis.command.options import RENAMED
from analysis.command.subjects import MOST, described
from analysis.entry import COMMANDS
from analysis.perception.options import StepOptions
from tests.scripts.commands import one_line

STEPS = {get_args(part)[1].name: get_args(part)[0] for part in get_args(StepOptions)}
CALLS = [(name,) for name in COMMANDS if name != "perception"] + [("perception", step) for step in STEPS]


class Parsed(Exception):
    """The options of a command."""


def called(monkeypatch: pytest.MonkeyPatch, command: str, *arguments: str) -> None:
    """Calls a command as its script does."""
    monkeypatch.setattr(sys, "argv", [command, *arguments])
    cli.run_cli(importlib.import_module(COMMANDS[command]).main)


def options_of(command: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The record from which a command parses its options."""

    def parse(options: Any, description: str) -> None:
        raise Parsed(options)

    module = importlib.import_module(COMMANDS[command])
    with monkeypatch.context() as patch, pytest.raises(Parsed) as found:
        patch.setattr(module, "parse", parse)
        module.main()
    return found.value.args[0]


def described_by_all(monkeypatch: pytest.MonkeyPatch) -> dict[str, dict[str, str]]:
    """The text of every option, by command and name."""
    plain = {name: options_of(name, monkeypatch) for (name, *rest) in CALLS if not rest}
    return {name: described(options) for name, options in {**plain, **STEPS}.items()}


@pytest.mark.parametrize("call", CALLS, ids=" ".join)
def test_no_box_of_a_help_has_more_than_ten_options(call: tuple[str, ...], monkeypatch, capsys) -> None:
    monkeypatch.setenv("COLUMNS", "80")  # one column of boxes
    with pytest.raises(SystemExit):
        called(monkeypatch, *call, "--help")
    text = capsys.readouterr().out
    arguments = text.partition("positional arguments")[2].partition("╰")[0]
    assert not re.findall(r"^│ \W*(?:STR|PATH|INT|FLOAT)\b.*", arguments, re.MULTILINE), "arguments without a name"
    assert not re.findall(r".*(?:\bNone\b|''|default: \)|\{,).*", text), "values that stand for none"
    parts = re.split(r"^ (\S.*?) *\n -{9,} *$", text, flags=re.MULTILINE)[1:]
    boxes = dict(zip(parts[::2], parts[1::2], strict=True))
    assert not re.search(r"(?<![\w.:])/\w+/", "".join(parts)), "a path of this machine"
    names = {title: re.findall(r"^  (?:-h, )?(--[a-z][\w.-]*)", box, re.MULTILINE) for title, box in boxes.items()}
    assert max(map(len, names.values())) <= MOST, names
    assert "further options" not in names, "an option has no subject"
    record = STEPS[call[-1]] if call[-1] in STEPS else options_of(*call, monkeypatch)
    assert sorted(itertools.chain(*names.values())) == sorted(["--help", *described(record)]), (
        "the help has every option"
    )


def test_no_option_has_two_meanings(monkeypatch) -> None:
    """The meaning is the first clause of the text; what follows it says what is particular to a command."""
    meanings = defaultdict(lambda: defaultdict(list))
    for command, texts in described_by_all(monkeypatch).items():
        for name, text in texts.items():
            meanings[name][re.split(r"[.;:](?:\s|$)", text)[0]].append(command)
    assert len(meanings) > 150 and len(meanings["--seed"]["Seed of all random numbers"]) > 10
    assert {name: dict(found) for name, found in meanings.items() if len(found) > 1} == {}


@pytest.mark.parametrize(
    ("call", "new"),
    [
        (("run", "fly-by", "--cache", "x"), "--references"),
        (("run", "fly-by", "--clock=wall"), "--ledger"),
        (("run", "fly-by", "--frames"), "--write-frames"),
        (("run", "fly-by", "--error-target", "0.1"), "--mse-target"),
        (("spectrum", "--frames", "16"), "--ideal-frames"),
        (("accelerators", "--scale", "0.1"), "--image-scale"),
        (("tiles", "glass", "--farm.workers", "1"), "--workers"),
        (("perception", "adaptive", "--span-s", "0", "1"), "--jod-span-s"),
    ],
)
def test_an_earlier_name_is_answered_with_the_new_one(call: tuple[str, ...], new: str, monkeypatch, capsys) -> None:
    with pytest.raises(SystemExit) as stop:
        called(monkeypatch, *call)
    said = capsys.readouterr().err
    assert stop.value.code == 2 and one_line(said) and f"expected {new}, the name of this option now" in said


def test_earlier_names_lead_to_options_that_there_are(monkeypatch) -> None:
    names = {name for texts in described_by_all(monkeypatch).values() for name in texts}
    assert {new for found in RENAMED.values() for new in found} <= names
