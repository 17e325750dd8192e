"""Numbers as formats of fewer bits hold them."""

from __future__ import annotations

import math

import pytest
import torch

from tsar.checks import ConfigError
from tsar.formats import NUMBER_FORMATS, UNORM_MAX, rounded

VALUES = torch.cat((torch.zeros(1), torch.logspace(-6, 0.17, 2000)))
ROUNDING = {"float32": 0.0, "bfloat16": 2.0**-8, "float16": 2.0**-11, "float8": 2.0**-3}
"""Half the distance from one number to the next, over the number."""


@pytest.mark.parametrize("form", NUMBER_FORMATS)
def test_a_format_holds_what_it_made(form: str) -> None:
    once = rounded(VALUES, form)
    assert torch.equal(rounded(once, form), once)
    assert once.dtype == (torch.float64 if form == "float64" else torch.float32)


@pytest.mark.parametrize("form", ROUNDING)
def test_values_are_rounded_to_the_nearest(form: str) -> None:
    normal = VALUES[VALUES >= torch.finfo(torch.float8_e5m2).smallest_normal]
    away = ((rounded(normal, form) - normal).abs() / normal).max()
    assert 0.85 * ROUNDING[form] <= away <= ROUNDING[form]


def test_colours_of_eight_bits_have_as_many_values_as_a_display() -> None:
    found = rounded(torch.linspace(0.0, 1.0, 20000).square() * UNORM_MAX, "unorm8").unique()
    assert len(found) == 256 and found[0] == 0.0 and found[-1] == UNORM_MAX
    assert torch.allclose(found.sqrt().diff(), torch.tensor(math.sqrt(UNORM_MAX) / 255.0), rtol=1e-3)


@pytest.mark.parametrize("form", [form for form in NUMBER_FORMATS if form != "unorm8"])
def test_what_is_beyond_a_format_becomes_its_greatest_and_infinity_stays(form: str) -> None:
    values = torch.tensor([3e38, -3e38, math.inf, -math.inf, math.nan])
    found = rounded(values, form)
    assert found[:2].isfinite().all() and found[0] > 5e4 and found[1] == -found[0]
    assert found[2] == math.inf and found[3] == -math.inf and found[4].isnan()


def test_a_format_that_is_not_known_is_refused() -> None:
    with pytest.raises(ConfigError, match="unorm8.*'int3'"):
        rounded(VALUES, "int3")
