"""Machine and versions."""

import importlib.metadata
from pathlib import Path

import pytest

from analysis.bench import machine as bench_machine
from analysis.bench.machine import cpu_model, installed, machine, versions


def test_the_processor_is_named_as_the_system_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = tmp_path / "cpuinfo"
    info.write_text("processor\t: 0\nmodel name\t: Quick CPU @ 3 GHz\nflags: none\n")
    monkeypatch.setattr(bench_machine, "_CPU_INFO", info)
    assert cpu_model() == "Quick CPU @ 3 GHz"
    monkeypatch.setattr(bench_machine, "_CPU_INFO", tmp_path / "missing")
    assert cpu_model()


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
