"""Machine and versions."""

import importlib.metadata

import pytest

from analysis.bench import machine as bench_machine
from analysis.bench.machine import installed, machine, versions


def test_cores_and_memory() -> None:
    found = machine()
    assert found["cores"] >= 1 and found["memory_gib"] > 0.1 and found["load_average"] >= 0.0 and "gpu" not in found


def test_versions_of_what_is_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    found = versions()
    assert set(found) == {"python", "torch", "warp", "numpy", "embreex", "mitsuba", "PyWavelets"}
    assert found["numpy"] == importlib.metadata.version("numpy")
    monkeypatch.setattr(bench_machine, "PACKAGES", {"absent": "no-such-distribution"})
    assert versions()["absent"] is None


def test_what_can_be_imported() -> None:
    assert installed("json") and not installed("no_such_module")
