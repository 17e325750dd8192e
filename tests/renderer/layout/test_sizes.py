"""Numbers that Python and C++ share are written in Python alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from renderer.compute import sizes as compute
from renderer.compute.native_code import declarations
from renderer.layout import sizes as layout
from renderer.stages import sizes as stages

RENDERER = Path(layout.__file__).resolve().parents[1]
HEADERS = sorted(RENDERER.glob("*/native/*.h"))
ROOMS = (compute.GIVEN, layout.GIVEN, stages.GIVEN, stages.FILTERING)
GIVEN = {name: value for given in ROOMS for name, value in given.items()}
OWN_OF_C = re.compile(r"//[^\n]*|\"[^\"\n]*\"")
TELLING = (
    *("FAR", "TINY", "SHORT", "SPHERE_SLACK", "PATCH_LEAST", "TEXELS_MOST", "SAMPLES_MAX", "AGE_STEPS", "GAP_MOST_S"),
    *("LUMINANCE_RED", "LUMINANCE_GREEN", "LUMINANCE_BLUE", "EDGE_GROWTH", "BETWEEN", "PRICE_ABOVE", "COUNT_LEAST"),
)
"""Numbers that mean nothing else anywhere."""


def code(header: Path) -> str:
    return OWN_OF_C.sub("", header.read_text(encoding="utf-8"))


def defined(text: str) -> set[str]:
    """Names that are declared as constants or in an enumeration, or assigned to."""
    names = set(re.findall(r"\b([A-Z][A-Z_0-9]*)\s*=(?!=)", text)) | set(re.findall(r"#define\s+(\w+)", text))
    for body in re.findall(r"\benum\b[^{;]*\{([^}]*)\}", text):
        names |= set(re.findall(r"\b[A-Z][A-Z_0-9]*\b", body))
    return names


def test_no_name_is_given_twice() -> None:
    assert len(GIVEN) == sum(map(len, ROOMS))


@pytest.mark.parametrize("header", HEADERS, ids=lambda header: header.name)
def test_no_header_defines_what_it_is_given(header: Path) -> None:
    text = code(header)
    assert not defined(text) & GIVEN.keys()
    numbers = {float(found) for found in re.findall(r"(?<![\w.])(\d+\.?\d*(?:e[+-]?\d+)?)", text)}
    assert not [name for name in TELLING if GIVEN[name] in numbers]


def test_every_number_is_used_by_a_header() -> None:
    words = {word for header in HEADERS for word in re.findall(r"\w+", code(header))}
    kinds = {f"{prefix}_{kind.name}" for prefix, of in layout.KINDS.items() for kind in of}
    assert GIVEN.keys() - words - kinds == set()


def test_definitions_are_found() -> None:
    text = "constexpr int WIDTH = 8, DEPTH = 3;\nenum { MESH, DISK };\n#define FAR 1e30"
    assert defined(text) == {"WIDTH", "DEPTH", "MESH", "DISK", "FAR"}


def test_declarations() -> None:
    assert declarations({"LANES": 16, "FAR": 1e30, "SHORT": 0.9999, "GROWTH": np.float64(0.35)}) == (
        "namespace given {\nconstexpr int LANES = 16;\nconstexpr float FAR = 1e+30f;\n"
        "constexpr float SHORT = 0.9999f;\nconstexpr double GROWTH = 0.35;\n}\n"
    )
