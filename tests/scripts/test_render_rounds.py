"""Stills in rounds: to an error, with layers, and from where they were interrupted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

import analysis.tracer.rounds
from tests.scripts.commands import call_script, one_line

STILL = ("fly-by", "--size", "48x32", "--time-s", "1", "--samples", "32", "--format", "exr")


def test_a_still_with_layers_goes_on_where_it_was_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    arguments = (*STILL, "--rounds", "8", "--error-target", "0.02", "--layers")
    real = analysis.tracer.rounds.render_rounds

    def interrupted(*given, **named):
        *rest, done = given

        def stop(samples, state) -> None:
            done(samples, state)
            if state.count.max() == 5:
                raise KeyboardInterrupt

        return real(*rest, stop, **named)

    def files(name: str) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()}

    monkeypatch.setattr(analysis.tracer.rounds, "render_rounds", interrupted)
    assert call_script("render.py", monkeypatch, *arguments, "--out", str(tmp_path / "a")) == 130
    assert "frame00000.rounds" in files("a") and "frame00000.exr" not in files("a")
    seen: list[int] = []

    def counted(*given, **named):
        seen.append(0 if given[-2] is None else int(given[-2].count.max()))
        return real(*given, **named)

    monkeypatch.setattr(analysis.tracer.rounds, "render_rounds", counted)
    for name in ("a", "b"):
        assert call_script("render.py", monkeypatch, *arguments, "--out", str(tmp_path / name)) == 0
    assert seen == [5, 0]
    assert files("a")["frame00000.exr"] == files("b")["frame00000.exr"] and "frame00000.rounds" not in files("a")
    with OpenEXR.File(str(tmp_path / "a" / "frame00000.exr"), separate_channels=True) as file:
        planes = {name: channel.pixels for name, channel in file.channels().items()}
    assert planes["Z"].shape == (32, 48) and {"albedo.R", "instance", "samples", "variance.B"} <= planes.keys()
    assert set(np.unique(planes["samples"])) <= {16.0, 20.0, 24.0, 28.0, 32.0}
    moving = planes["instance"] >= 0
    assert moving.any() and np.isfinite(planes["motion.X"][moving]).all() and np.abs(planes["motion.X"]).max() > 0.1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--rounds", "5"), "samples: expected a multiple of the 5 rounds, got 32"),
        (("--rounds", "1"), "rounds: expected at least 2, got 1"),
        (("--layers", "--format", "png"), "layers: expected the format exr, got 'png'"),
        (("--error-target", "-1"), "error_target: expected between 0 and 1"),
    ],
)
def test_rounds_that_cannot_be(arguments, message: str, tmp_path: Path, monkeypatch, capsys) -> None:
    assert call_script("render.py", monkeypatch, *STILL, *arguments, "--out", str(tmp_path / "out")) == 2
    shown = capsys.readouterr()
    assert one_line(shown.err) and message in shown.err


def test_a_denoised_still_keeps_its_layers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    pytest.importorskip("pyoidn")
    for name, more in (("noisy", ()), ("clear", ("--denoise",))):
        arguments = (*STILL, "--layers", *more, "--out", str(tmp_path / name))
        assert call_script("render.py", monkeypatch, *arguments) == 0, capsys.readouterr().err
    with (
        OpenEXR.File(str(tmp_path / "noisy" / "frame00000.exr"), separate_channels=True) as first,
        OpenEXR.File(str(tmp_path / "clear" / "frame00000.exr"), separate_channels=True) as second,
    ):
        noisy, clear = ({key: one.pixels for key, one in file.channels().items()} for file in (first, second))
    assert noisy.keys() == clear.keys()
    changed = {key for key in noisy if not np.array_equal(noisy[key], clear[key])}
    assert changed == {"R", "G", "B"}
