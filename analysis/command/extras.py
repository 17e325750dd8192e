"""The extras of the distribution, and the message of a command that needs one that is not installed."""

from __future__ import annotations

import importlib.util

from analysis.command.cli import InputError

DISTRIBUTION = "tsar-render"
"""Name under which the packages are installed; they are imported as tsar, renderer, scenes and analysis."""

EXTRAS: dict[str, dict[str, str]] = {
    "study": {"dask": "dask", "distributed": "distributed", "bokeh": "bokeh"},
    "search": {"optuna": "optuna"},
    "formats": {"astral": "astral", "defusedxml": "defusedxml"},
    "usd": {"pxr": "usd-core"},
    "peers": {"embreex": "embreex", "mitsuba": "mitsuba", "pyluxcore": "pyluxcore", "pywt": "PyWavelets"},
    "denoise": {"pyoidn": "pyoidn"},
    "psignifit": {"psignifit": "psignifit"},
}
"""For each extra its modules and their distributions, as in the project file."""
DISPENSABLE = ("bokeh",)
"""Modules without which the commands of their extras run, and say what they then lack."""


def require_extra(*extras: str) -> None:
    """Checks that every module of the extras that is indispensable can be imported, without importing them.

    Args:
        extras: names in :data:`EXTRAS`.

    Raises:
        InputError: a module is missing; the message names its distribution and the extra.
    """
    for extra in extras:
        for module, distribution in EXTRAS[extra].items():
            if module not in DISPENSABLE and not has_module(module):
                raise InputError(_missing(distribution, extra))


def has_module(name: str) -> bool:
    """Whether a module can be imported, without importing it."""
    return importlib.util.find_spec(name) is not None


def extra_of(error: ModuleNotFoundError) -> InputError | None:
    """The error to report for an import that failed; None if the module belongs to no extra."""
    root = (error.name or "").partition(".")[0]
    for extra, modules in EXTRAS.items():
        for module, distribution in modules.items():
            if root in (module, distribution):
                return InputError(_missing(distribution, extra))
    return None


def _missing(distribution: str, extra: str) -> str:
    return f"expected the package {distribution}, found none; {installed_by(extra)}"


def installed_by(extra: str) -> str:
    """The end of a message about a package that is missing: how to install it."""
    where = f"(in a checkout: pip install --editable '.[{extra}]')"
    return f"the extra '{extra}' of {DISTRIBUTION} installs it {where}"
