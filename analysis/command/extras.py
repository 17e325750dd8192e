"""The extras of the distribution, and the message of a command that needs one that is not installed."""

from __future__ import annotations

import importlib.util

from analysis.command.cli import InputError

DISTRIBUTION = "tsar-render"
"""Name under which the packages are installed; they are imported as tsar, renderer, scenes and analysis."""

EXTRAS: dict[str, dict[str, str]] = {
    "study": {"dask": "dask", "distributed": "distributed"},
    "search": {"optuna": "optuna"},
    "formats": {"astral": "astral", "defusedxml": "defusedxml"},
    "usd": {"pxr": "usd-core"},
    "peers": {"embreex": "embreex", "mitsuba": "mitsuba", "pyluxcore": "pyluxcore", "pywt": "PyWavelets"},
    "denoise": {"pyoidn": "pyoidn"},
    "psignifit": {"psignifit": "psignifit"},
}
"""For each extra its modules and their distributions, as in the project file."""


def require_extra(*extras: str) -> None:
    """Checks that every module of the extras can be imported, without importing them.

    Args:
        extras: names in :data:`EXTRAS`.

    Raises:
        InputError: a module is missing; the message names its distribution and the extra.
    """
    for extra in extras:
        for module, distribution in EXTRAS[extra].items():
            if importlib.util.find_spec(module) is None:
                raise InputError(_missing(distribution, extra))


def extra_of(error: ModuleNotFoundError) -> InputError | None:
    """The error to report for an import that failed; None if the module belongs to no extra."""
    root = (error.name or "").partition(".")[0]
    for extra, modules in EXTRAS.items():
        for module, distribution in modules.items():
            if root in (module, distribution):
                return InputError(_missing(distribution, extra))
    return None


def _missing(distribution: str, extra: str) -> str:
    return (
        f"expected the package {distribution}, found none; the extra '{extra}' of {DISTRIBUTION} installs it "
        f"(in a checkout: pip install --editable '.[{extra}]')"
    )
