"""Every closed choice of every record is checked when the record is made."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pytest

from analysis.suitability.options import SuitabilityOptions
from analysis.tracer.render_options import RenderOptions
from tsar.config import ConfigError, ErrorConfig, ReconstructionConfig, ResponseConfig, closed_choices

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = "tsar", "renderer", "analysis"


def holds_choices(kind: Any) -> bool:
    """Whether there is a ``Literal`` anywhere in an annotation."""
    return get_origin(kind) is Literal or any(map(holds_choices, get_args(kind)))


def records_with_choices() -> Iterator[tuple[type, str]]:
    """Dataclasses and those of their fields that are closed choices, of all modules that speak of both."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if not re.search(r"\bLiteral\b|Options|Config|Name\b", source := path.read_text(encoding="utf-8")):
                continue
            if "@dataclass" not in source:
                continue
            module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
            for record in vars(module).values():
                if (
                    inspect.isclass(record)
                    and dataclasses.is_dataclass(record)
                    and record.__module__ == module.__name__
                ):
                    yield from ((record, name) for name, kind in hints_of(record).items() if holds_choices(kind))


def hints_of(record: type) -> dict[str, Any]:
    """Annotations of a dataclass; of one that names what is imported for the type checker only, those in its source."""
    try:
        return get_type_hints(record)
    except NameError:
        lines = inspect.getsource(record).splitlines()
        assert not any("Literal" in line for line in lines), f"{record}: annotations cannot be read"
        return {}


def test_no_record_takes_what_it_does_not_list() -> None:
    found = list(records_with_choices())
    assert len(found) > 25 and (ErrorConfig, "form") in found
    taken = []
    for record, name in found:
        many = get_origin(get_type_hints(record)[name]) is tuple
        try:
            make(record, **{name: ("made-up",) if many else "made-up"})
        except ConfigError as error:
            if not re.search(rf"{name}: expected (one|some) of .*made-up", str(error)):
                taken.append(f"{record.__name__}.{name}: {error}")
        except Exception as error:
            taken.append(f"{record.__name__}.{name}: {type(error).__name__} {error}")
        else:
            taken.append(f"{record.__name__}.{name}")
    assert not taken, "\n".join(taken)


def make(record: type, **values: Any) -> None:
    """What making a record does, past the checks of types that are in force in tests only."""
    made, hints = object.__new__(record), get_type_hints(record)
    for field in dataclasses.fields(record):
        default = field.default
        if default is dataclasses.MISSING:
            default = get_args(hints[field.name])[0] if get_origin(hints[field.name]) is Literal else None
        if field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        object.__setattr__(made, field.name, values.get(field.name, default))
    if hasattr(made, "__post_init__"):
        made.__post_init__()


def test_the_message_names_field_choices_and_value() -> None:
    with pytest.raises(ConfigError, match=r"^error\.form: expected one of contrast, difference, got 'other'$"):
        make(ErrorConfig, form="other")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ErrorConfig(norm="l1"), r"^error\.norm: expected one of l2, linf, got 'l1'$"),
        (lambda: ResponseConfig(solver="waterfil"), r"^response\.solver: .*'waterfil' \(nearest: waterfill\)$"),
        (lambda: ReconstructionConfig(method="x"), r"^reconstruction\.method: expected one of blend, got 'x'$"),
        (lambda: RenderOptions("glass", point_set="y"), r"^point_set: expected one of hammersley, .*, got 'y'$"),
        (
            lambda: SuitabilityOptions(policies=("framed",), solvers=("square",)),
            r"^solvers: expected none without the policy thesis, got ",
        ),
        (lambda: SuitabilityOptions(solvers=("z",)), r"^solvers: expected one of waterfill, .*, got 'z'$"),
    ],
)
def test_a_name_that_no_table_has_is_refused_with_those_that_it_has(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make()


@dataclasses.dataclass(frozen=True)
@closed_choices()
class Wider(ErrorConfig):
    form: Literal["contrast", "difference", "more"] = "contrast"  # type: ignore[assignment]


def test_a_record_that_lists_more_takes_more() -> None:
    assert Wider(form="more").form == "more"
    with pytest.raises(ConfigError, match="form: expected one of contrast, difference, more, got 'less'"):
        Wider(form="less")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="spatial_offset"):
        Wider(spatial_offset=1e9)


@dataclasses.dataclass(frozen=True)
@closed_choices()
class Optional:
    part: Literal["a", "b"] | None = None


def test_a_choice_may_be_left_out() -> None:
    assert Optional().part is None and Optional("b").part == "b"
    with pytest.raises(ConfigError, match="part: expected one of a, b, got 'c'"):
        Optional("c")  # type: ignore[arg-type]
