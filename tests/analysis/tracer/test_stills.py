"""Stills on disk: kept if they are the requested ones, always counted, and foreign files are not touched."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from analysis.tracer.stills import render_stills
from renderer.film.files import read_exr

TIMES = {number: 0.1 * number for number in range(4)}


class Pictures:
    """Numbered pictures with as many values that are not finite as their number says; counts what was rendered."""

    def __init__(self) -> None:
        self.numbers: list[int] = []

    def __call__(self, number: int, time_s: float) -> torch.Tensor:
        self.numbers.append(number)
        image = torch.full((4, 4, 3), float(number))
        image.view(-1)[:number] = (torch.nan, torch.inf)[number % 2]
        return image


def render(folder: Path, key: str = "k", ending: str = ".exr", times_s: dict[int, float] = TIMES) -> tuple:
    pictures = Pictures()
    return (*render_stills(pictures, times_s, folder, ending, key), pictures.numbers)


@pytest.mark.parametrize("ending", [".exr", ".png", ".ppm"])
def test_a_resumed_sequence_counts_as_an_unbroken_one(tmp_path: Path, ending: str) -> None:
    assert render(tmp_path / "whole", ending=ending) == (4, 6, [0, 1, 2, 3])
    assert render(tmp_path / "broken", ending=ending, times_s={3: 0.3}) == (1, 3, [3])
    assert render(tmp_path / "broken", ending=ending) == (3, 6, [0, 1, 2])
    assert render(tmp_path / "broken", ending=ending) == (0, 6, [])


def test_damaged_and_foreign_stills_are_named_and_made_again(tmp_path: Path, capsys) -> None:
    render(tmp_path)
    first, second, third, _ = (tmp_path / f"frame{number:05d}.exr" for number in TIMES)
    whole = third.read_bytes()
    first.write_bytes(second.read_bytes())
    second.write_bytes(second.read_bytes()[:-1])
    third.write_bytes(whole[:200] + bytes([whole[200] ^ 4]) + whole[201:])
    assert render(tmp_path) == (3, 6, [0, 1, 2])
    said = capsys.readouterr().err
    assert all(str(file) in said for file in (first, second, third)) and third.read_bytes() == whole


def test_another_key_replaces_the_stills_one_by_one(tmp_path: Path, capsys) -> None:
    for name in ("frame-notes.md", "frames.csv"):
        (tmp_path / name).write_text("mine")
    render(tmp_path, times_s={number: 0.0 for number in range(6)} | {0: 0.0})
    with pytest.raises(KeyboardInterrupt):
        render_stills(lambda number, time_s: _stop(number), TIMES, tmp_path, ".exr", "other")
    assert len(list(tmp_path.glob("frame0*.exr"))) == 6, "an interrupted run takes no more than it has made"
    (tmp_path / "frame00005.exr").write_bytes(b"painted over")
    assert render(tmp_path, "other") == (3, 6, [1, 2, 3])
    said = capsys.readouterr().err
    assert "frame00005.exr: was changed since it was written; it stays" in said and "1 files of an earlier run" in said
    left = sorted(path.name for path in tmp_path.iterdir())
    stills = [f"frame{number:05d}.exr" for number in (0, 1, 2, 3, 5)]
    assert left == ["files.journal", "frame-notes.md", *stills, "frames.csv"]


def _stop(number: int) -> torch.Tensor:
    if number == 1:
        raise KeyboardInterrupt
    return torch.zeros(4, 4, 3)


def test_a_file_of_the_users_where_a_still_belongs_is_refused(tmp_path: Path) -> None:
    mine = tmp_path / "frame00002.exr"
    mine.write_bytes(b"mine")
    with pytest.raises(ValueError, match=r"frame00002\.exr: expected no file that this command did not make; move it"):
        render(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["frame00002.exr"] and mine.read_bytes() == b"mine"
    mine.unlink()
    assert render(tmp_path)[0] == 4 and np.isfinite(read_exr(tmp_path / "frame00000.exr")).all()
