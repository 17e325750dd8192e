"""One line about a command line that cannot be parsed: the option that was typed, what it expects, and what arrived."""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Sequence

from tsar.named import not_among

_FRAME = re.compile(r"[╭╮╰╯│─]+|-{3,}")
_TITLES = "Value error|Invalid choice|Missing argument|Parsing error"
_TITLE = re.compile(rf"^(?:(?:{_TITLES}) )?(?:Error parsing (?!--)[\w.]+: )?")
_REJECTED = re.compile(r"Error parsing (?P<name>--\S+): .* Argument helptext: (?P=name) (?P<about>.*)$")
_KIND = r"(?:None|INT|FLOAT|STR|PATH|\.\.\.|[\[\]{}|])"
_KINDS = re.compile(rf"^{_KIND}+(?: {_KIND}+)*(?= |$)")
_IN_WORDS = {
    "INT": "a whole number",
    "FLOAT": "a number",
    "STR": "a name",
    "PATH": "a file",
    "[INT [INT ...]]": "whole numbers",
    "[FLOAT [FLOAT ...]]": "numbers",
    "[STR [STR ...]]": "names",
    "[PATH [PATH ...]]": "files",
}
_CHOICE = re.compile(
    r"invalid choice '(?P<got>.*)' for argument '(?P<name>--\S+)'\. Expected one of (?P<all>\(.*\))\.$"
)
_MISSING = re.compile(r"Missing value for argument '(?P<name>--\S+)'\. Expected (?P<count>\d+) values")
_UNKNOWN = re.compile(r"Unrecognized (?:or misplaced )?options: (?P<first>.*?)(?:, | \(applied to |$)")
_RECORD = re.compile(r"^(?:\w+\.)+(?P<name>\w+)(?=: )")


def one_line(box: str, given: Sequence[str]) -> str:
    """The message inside the box that the parser draws, without its title and advice.

    Args:
        box: what the parser printed.
        given: arguments of the command line.
    """
    inside = (re.sub(r"Error parsing \w+: ", "", line) for line in box.splitlines() if line[:1] != "╭")
    lines = [re.sub(r"\s+", " ", _FRAME.sub(" ", line)).strip() for line in inside]
    text = " ".join(line for line in lines if line)
    text = _TITLE.sub("", text.partition(" For full helptext")[0])
    return (
        _choice(text)
        or _rejected(text, given)
        or _missing(text, given)
        or _unknown(text)
        or text
        or "the command line cannot be parsed"
    )


def as_typed(message: str, given: Sequence[str]) -> str:
    """A message about a field of a record, under the name of the option by which it was given.

    Args:
        message: such as ``tiling.rate_max: expected 1, 2, 4 or 8, got 3``.
        given: arguments of the command line, such as ``--rate-max 3``.
    """
    found = _RECORD.match(message)
    options = {argument.partition("=")[0].replace("_", "-") for argument in given}
    if found is None or f"--{found['name'].replace('_', '-')}" not in options:
        return message
    return message[found.start("name") :]


def _rejected(text: str, given: Sequence[str]) -> str:
    """A line about values of the wrong kind or number; empty if the text is about something else."""
    found = _REJECTED.search(text)
    kind = _KINDS.match(found["about"]) if found else None
    if found is None or kind is None:
        return ""
    name = found["name"]
    expected = " or ".join(map(_in_words, kind[0].replace("{None}|", "").split("|")))
    return f"{name}: expected {expected}, got {_values_of(name, given)}"


def _in_words(kind: str) -> str:
    """A kind of value as one says it, such as ``6 numbers``."""
    kind = re.sub(r"[{}]", "", kind)
    names = kind.split()
    if len(names) > 1 and len(set(names)) == 1:
        return f"{len(names)} {_IN_WORDS[f'[{names[0]} [{names[0]} ...]]']}"
    return _IN_WORDS.get(kind, kind)


def _missing(text: str, given: Sequence[str]) -> str:
    """A line about too few values; empty if the text is about something else."""
    found = _MISSING.search(text)
    if found is None:
        return ""
    count = "a value" if found["count"] == "1" else f"{found['count']} values"
    return f"{found['name']}: expected {count}, got {_values_of(found['name'], given)}"


def _unknown(text: str) -> str:
    """A line about the first word that the command does not know; empty if the text is about something else."""
    found = _UNKNOWN.search(text)
    if found is None:
        return ""
    word = found["first"]
    return (
        f"expected an option of this command, got {word}"
        if word[:1] == "-"
        else f"expected no further argument, got {word!r}"
    )


def _values_of(name: str, given: Sequence[str]) -> str:
    """The words after an option, up to the next one, as they were typed."""
    for place, argument in enumerate(given):
        option, equals, value = argument.partition("=")
        if option.replace("_", "-") == name:
            rest = [value] if equals else itertools.takewhile(lambda one: one[:2] != "--", given[place + 1 :])
            return ", ".join(map(repr, rest)) or "none"
    return "none"


def _choice(text: str) -> str:
    """A line about a name that is none of a list, with the nearest one; empty if the text is about something else."""
    found = _CHOICE.search(text)
    if found is None:
        return ""
    known = [str(one) for one in ast.literal_eval(found["all"])]
    if "None" in known:  # stands for none; the parser has such names in an order that differs between runs
        known = sorted(set(known) - {"None"})
    return f"{found['name']}: {not_among(found['got'], known)}"
