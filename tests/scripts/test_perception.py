"""The study from job files to thresholds, small."""

from __future__ import annotations

import io
import json
import os
import signal
from pathlib import Path

import av
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from analysis.perception.observers import drawn_observers, simulated_trials
from analysis.perception.stimuli import frames_of, hash_of, png_of
from tests.analysis.perception.builders import write_stimuli
from tests.scripts.commands import call_script, one_line, started_script


def summary(folder: Path) -> dict:
    return json.loads((folder / "summary.json").read_text())


def test_stimuli_are_rendered_once_and_listed_with_their_hash(tmp_path: Path, monkeypatch, capsys) -> None:
    job, out = tmp_path / "job.txt", tmp_path / "out"
    job.write_text("Plane_scene\n2\n1 8\n1\nhammersley\n1\nbox\n")
    arguments = ("stimuli", str(job), "--width-px", "16", "--frames", "2", "--out", str(out))
    assert call_script("perception.py", monkeypatch, *arguments) == 0, capsys.readouterr().err
    manifest = json.loads((out / "manifest.json").read_text())
    assert [row["samples"] for row in manifest["stimuli"]] == [1, 8] and manifest["size_px"] == [16, 16]
    assert manifest["stimuli"][0]["sha256"] != manifest["stimuli"][1]["sha256"]
    assert all((out / row["folder"] / name).exists() for row in manifest["stimuli"] for name in row["files"])
    assert call_script("perception.py", monkeypatch, *arguments) == 0
    assert summary(out)["rendered_now"] == 0
    again = json.loads((out / "manifest.json").read_text())
    assert [row["sha256"] for row in again["stimuli"]] == [row["sha256"] for row in manifest["stimuli"]]


def test_stimuli_are_kept_linear_and_as_lossless_video(tmp_path: Path, monkeypatch, capsys) -> None:
    job, out = tmp_path / "job.txt", tmp_path / "out"
    job.write_text("Plane_scene\n1\n8\n2\nowen+blue cells-time\n1\ntriangle\n")
    arguments = (
        "stimuli",
        str(job),
        "--width-px",
        "16",
        "--frames",
        "2",
        "--format",
        "exr",
        "--video",
        "--out",
        str(out),
    )
    assert call_script("perception.py", monkeypatch, *arguments) == 0, capsys.readouterr().err
    manifest = json.loads((out / "manifest.json").read_text())
    assert [row["point_set"] for row in manifest["stimuli"]] == ["owen+blue", "cells-time"]
    for row in manifest["stimuli"]:
        frames = frames_of(out, row)
        film = out / row["folder"] / row["video"]
        with av.open(str(film)) as container:
            np.testing.assert_array_equal(
                [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)], frames
            )
        assert hash_of([film]) == row["video_sha256"] and (frames > 0).any()
        shown = Image.open(io.BytesIO(png_of(out / row["folder"] / row["files"][0])))
        np.testing.assert_array_equal(np.asarray(shown), frames[0])
    written = film.stat().st_mtime_ns
    assert call_script("perception.py", monkeypatch, *arguments) == 0 and film.stat().st_mtime_ns == written


def test_simulated_answers_and_their_analysis(tmp_path: Path, monkeypatch, capsys) -> None:
    stimuli = write_stimuli(tmp_path / "stimuli", side=48, frames=4, scenes=("planescene", "spheresscene"))
    trials, found = tmp_path / "trials", tmp_path / "found"
    simulate = ("simulate", str(stimuli), "--observers", "6", "--sigma-jod", "0.5", "--out", str(trials))
    assert call_script("perception.py", monkeypatch, *simulate) == 0, capsys.readouterr().err
    table = pd.read_parquet(trials / "trials-simulated.parquet")
    assert len(table) == 6 * 6 * 4 and set(table["observer_kind"]) == {"simulated"}
    jod = pd.read_csv(trials / "jod.csv").set_index(["scene", "samples"])["jod"]
    assert jod["planescene", 1] > jod["planescene", 8] > jod["planescene", 64] == 0.0
    assert "differencing" in summary(trials)["task"] and (trials / "sigma_sweep.png").exists()
    file = str(trials / "trials-simulated.parquet")
    analyse = ("analyse", file, "--bootstraps", "20", "--psignifit", "--power-repetitions", "2", "--out", str(found))
    assert call_script("perception.py", monkeypatch, *analyse) == 0, capsys.readouterr().err
    for name in ("scenes", "point_sets", "planescene", "hammersley"):
        assert (found / f"{name}.png").stat().st_size > 5_000
    assert len(pd.read_csv(found / "power.csv")) == 8 and len(pd.read_csv(found / "fits.csv")) == 2 + 2 + 1 + 2
    assert summary(found)["observer_kind"] == "simulated" and summary(found)["left_out"] == 0
    by_parquet = (found / "fits.csv").read_bytes()
    again = (*analyse[:1], file.replace(".parquet", ".csv"), *analyse[2:])
    assert call_script("perception.py", monkeypatch, *again) == 0, capsys.readouterr().err
    assert (found / "fits.csv").read_bytes() == by_parquet, "the table is the same as CSV"
    assert "simulated observers" in capsys.readouterr().out


@pytest.mark.parametrize("levels", [(1, 8, 64), (8,)])
def test_one_condition_is_analysed(tmp_path: Path, monkeypatch, capsys, levels: tuple[int, ...]) -> None:
    rows = [{"scene": "a", "point_set": "b", "time_filter": "c", "samples": one, "jod": 3.0 / one} for one in levels]
    trials = simulated_trials(pd.DataFrame(rows), drawn_observers(2, 0, 0.1, 0.0), 4, 0)
    trials.assign(correct=trials["correct"].map({True: "yes", False: "no"})).to_parquet(tmp_path / "trials.parquet")
    analyse = ("analyse", str(tmp_path / "trials.parquet"), "--bootstraps", "20", "--power-repetitions", "1")
    assert call_script("perception.py", monkeypatch, *analyse, "--out", str(tmp_path)) == 0, capsys.readouterr().err
    assert len(pd.read_csv(tmp_path / "tests.csv")) == len(pd.read_csv(tmp_path / "pairs.csv")) == 0
    found = summary(tmp_path)
    assert (
        len(found["fits"]) == 4
        and found["fits"][0]["trials"] == 8 * len(levels)
        and ("power" in found) == (len(levels) > 1)
    )


def test_known_thresholds_are_given_back(tmp_path: Path, monkeypatch, capsys) -> None:
    short = (
        "--experiments",
        "12",
        "--bootstraps",
        "60",
        "--sigmas",
        "1",
        "--lapses",
        "0",
        "--jnds",
        "40",
        "--spreads",
        "0.5",
    )
    assert call_script("perception.py", monkeypatch, "recover", *short, "--out", str(tmp_path)) == 0
    (row,) = summary(tmp_path)["rows"]
    assert row["coverage_low"] < 0.95 and row["jnd_ratio_median"] == pytest.approx(1.0, abs=0.15)
    (null,) = summary(tmp_path)["tests"]
    assert 60 < null["tests"] <= 8 * 12 and 0.0 <= null["by_observer"] < 0.15
    said = capsys.readouterr().out
    assert "the 95 % interval holds it in" in said and "% are below 5 % with one entry an observer" in said


def test_a_changed_stimulus_is_noticed(tmp_path: Path, monkeypatch, capsys) -> None:
    stimuli = write_stimuli(tmp_path / "stimuli", side=16)
    frame = stimuli / "planescene" / "hammersley-box-0008" / "frame00000.png"
    frame.write_bytes((stimuli / "planescene" / "hammersley-box-0001" / "frame00000.png").read_bytes())
    status = call_script("perception.py", monkeypatch, "simulate", str(stimuli), "--out", str(tmp_path / "out"))
    error = capsys.readouterr().err
    assert status == 2 and "expected the frames of the manifest" in error and "Traceback" not in error


def test_a_session_is_served_once_and_ends_with_its_table(tmp_path: Path, monkeypatch, capsys) -> None:
    stimuli, out = write_stimuli(tmp_path / "stimuli"), tmp_path / "out"
    arguments = ("serve", "ANNA", "--stimuli", str(stimuli), "--out", str(out))
    with started_script("perception.py", tmp_path, *arguments) as server:
        assert server.stderr is not None and server.stdout is not None
        assert "in a browser" in next(line for line in server.stderr if "http://127.0.0.1:" in line)
        assert call_script("perception.py", monkeypatch, *arguments) == 2
        refused = capsys.readouterr().err
        assert one_line(refused) and f"{out} is in use by process {server.pid} on " in refused
        os.killpg(server.pid, signal.SIGINT)
        assert "0 of 12 trials answered" in server.stdout.read() and "Traceback" not in server.stderr.read()
    assert server.returncode == 0 and (out / "trials-human.parquet").exists()
    (out / "answers.sqlite").write_bytes(b"SQLite")
    assert call_script("perception.py", monkeypatch, *arguments) == 2
    refused = capsys.readouterr().err
    assert one_line(refused) and "answers.sqlite: expected the answers of a session, found a damaged file" in refused
