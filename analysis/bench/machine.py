"""The machine and the versions on which a benchmark was measured."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import platform
from typing import Any

from analysis.storage.provenance import cpu_model
from tsar.memory import core_count

PACKAGES = {
    "torch": "torch",
    "warp": "warp-lang",
    "numpy": "numpy",
    "embreex": "embreex",
    "mitsuba": "mitsuba",
    "PyWavelets": "PyWavelets",
}
"""Ours and the peers: name in the report and name of the distribution."""


def machine(device: str = "cpu") -> dict[str, Any]:
    """CPU model, cores this process may use, memory, the GPU where one is used, and the load average of the last
    minute."""
    import psutil

    cores = core_count()
    found = {"cpu": cpu_model(), "cores": cores, "memory_gib": round(psutil.virtual_memory().total / 2**30, 1)}
    found["load_average"] = round(psutil.getloadavg()[0], 2)
    if device != "cpu":
        import torch

        found["gpu"] = torch.cuda.get_device_name(device)
    return found


def versions() -> dict[str, str | None]:
    """Version of each package that ours depends on or is compared with; None where it is not installed."""
    found: dict[str, str | None] = {"python": platform.python_version()}
    for name, distribution in PACKAGES.items():
        try:
            found[name] = importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:
            found[name] = None
    return found


def uses_avx512(isa: str) -> bool:
    """Whether code for an instruction set (``native``, ``avx2`` or ``avx512``) uses AVX-512 here."""
    import torch

    has = torch.backends.cpu.get_cpu_capability() == "AVX512"
    return isa == "avx512" or (isa == "native" and has)


def installed(module: str) -> bool:
    """Whether a peer can be imported."""
    return importlib.util.find_spec(module) is not None
