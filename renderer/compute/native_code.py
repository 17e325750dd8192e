"""Module options with which kernels can call the C++ in the ``native/`` folders; Warp's compiler builds it with
them.

Warp keeps compiled modules under a hash of their code and options. A path in the options would become part of it, and
every checkout would compile again. So a module gets the text of the headers that it needs, and no path. The hash then
follows from the content: of the kernels, of these headers and their constants, and of the compiler's options; Warp adds
its own version, that of LLVM, and the instruction set.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from renderer.compute import sizes

_RENDERER = Path(__file__).resolve().parents[1]
_DIRECTIVE = re.compile(r'^#(?:include "(?P<header>[^"]+)"|pragma once)$', re.MULTILINE)
_QUIET = '#pragma clang diagnostic ignored "-Wpsabi"\n'
"""Where registers are narrower than sixteen floats, Clang warns at every function that takes or returns a vector that
its calling convention differs from that of code for wider registers. That does not apply: a module is compiled as a
whole, for one processor."""


def module_options(*headers: str, given: Mapping[str, float] | None = None) -> dict[str, Any]:
    """Options of a Warp module whose kernels call functions of these headers.

    Args:
        headers: names of files in a room's ``native/``.
        given: constants in the namespace ``given`` of the headers, in addition to those of
            :mod:`renderer.compute.sizes`.
    """
    constants = declarations({**sizes.GIVEN, **(given or {})})
    code = _QUIET + constants + "".join(texts(*headers)) + '#line 1 "kernels"\n'
    return {"enable_backward": False, "extra_build_options": wp.ModuleBuildOptions(extra_cpu_preamble=code)}


def texts(*headers: str) -> Iterator[str]:
    """Texts of headers and of all that they include, each once and after those that it includes.

    Each text begins with a line directive that names its file from ``renderer`` on, and has the lines of its file:
    directives that a text in one piece does not need are empty lines.
    """
    seen: set[str] = set()
    for header in headers:
        yield from _texts(header, seen)


def _texts(header: str, seen: set[str]) -> Iterator[str]:
    if header in seen:
        return
    seen.add(header)
    path = _paths()[header]
    text = path.read_text(encoding="utf-8")
    for found in _DIRECTIVE.finditer(text):
        if found["header"]:
            yield from _texts(found["header"], seen)
    yield f'#line 1 "{path.relative_to(_RENDERER.parent).as_posix()}"\n{_DIRECTIVE.sub("", text)}'


@cache
def _paths() -> dict[str, Path]:
    """Headers by name, of all rooms."""
    return {path.name: path for path in _RENDERER.glob("*/native/*.h")}


def declarations(given: Mapping[str, float]) -> str:
    """C++ declarations of constants: integers as ``int``, ``numpy.float64`` as ``double``, others as ``float``."""
    return "namespace given {\n" + "".join(_declared(name, value) for name, value in given.items()) + "}\n"


def _declared(name: str, value: float) -> str:
    if isinstance(value, int):
        return f"constexpr int {name} = {value!r};\n"
    kind, suffix = ("double", "") if isinstance(value, np.float64) else ("float", "f")
    return f"constexpr {kind} {name} = {float(value)!r}{suffix};\n"
