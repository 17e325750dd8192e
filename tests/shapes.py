"""Checks of shapes and types at run time in every test, up to a number of checks.

A cycle passes about a hundred checks, which take longer than the cycle. The thousandth call in a test has the same
shapes as the calls before it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jaxtyping
from beartype import BeartypeConf, beartype

CHECKS_MOST = 5000
"""Most checks in one test: those of about twenty cycles."""

_conf = BeartypeConf(is_pep484_tower=True)  # an int passes for a float, as in Python
_made = 0


def begin() -> None:
    """Switches all checks on again, at the beginning of a test."""
    global _made
    _made = 0
    jaxtyping.config.update("jaxtyping_disable", False)


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """The type checker for jaxtyping: a function whose calls are checked while the test has checks left."""
    checks = beartype(function, conf=_conf)

    @functools.wraps(function)
    def counted(*arguments: Any, **named: Any) -> Any:
        global _made
        _made += 1
        if _made > CHECKS_MOST:
            jaxtyping.config.update("jaxtyping_disable", True)
        return checks(*arguments, **named)

    return counted
