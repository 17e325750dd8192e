"""Checks of shapes and types at run time, in every test, but not again and again.

A cycle passes some hundred checks, and they take longer than the cycle. What a test does for the thousandth time has
the shapes that it had before.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jaxtyping
from beartype import BeartypeConf, beartype

CHECKS_MOST = 5000
"""Checks in one test, at most: those of some twenty cycles."""

_conf = BeartypeConf(is_pep484_tower=True)  # an int passes for a float, as in Python
_made = 0


def begin() -> None:
    """Has everything checked again, as a test begins."""
    global _made
    _made = 0
    jaxtyping.config.update("jaxtyping_disable", False)


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose calls are checked while the test has checks left: the type checker that jaxtyping is given."""
    checks = beartype(function, conf=_conf)

    @functools.wraps(function)
    def counted(*arguments: Any, **named: Any) -> Any:
        global _made
        _made += 1
        if _made > CHECKS_MOST:
            jaxtyping.config.update("jaxtyping_disable", True)
        return checks(*arguments, **named)

    return counted
