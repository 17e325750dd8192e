"""References are rendered once, go on where they stopped, and are named by everything that decides their content."""

from __future__ import annotations

import dataclasses
import json
import os
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch import Tensor

from analysis.reference import Reference, ReferenceSpec, obtain

SPEC = ReferenceSpec("scene", "s" * 8, "r" * 8, start_s=0.5, rate_hz=10.0, count=5, resolution_px=4, samples_per_axis=2)


class Renderer:
    """Renders a number for the time, counts, and breaks at an image if told to."""

    def __init__(self, break_at: int | None = None, error: type[BaseException] = RuntimeError) -> None:
        self.times: list[float] = []
        self._break_at, self._error = break_at, error

    def __call__(self, time_s: float) -> Tensor:
        if len(self.times) == self._break_at:
            raise self._error
        self.times.append(time_s)
        return torch.arange(48.0).reshape(4, 4, 3) / 64 + time_s


def get(cache: Path, render: Callable[[float], Tensor], spec: ReferenceSpec = SPEC) -> Reference:
    return obtain(cache, spec, render, lambda done, total: None)


def test_renders_every_time_once_and_reuses(tmp_path: Path) -> None:
    first, shown = Renderer(), []
    found = obtain(tmp_path / "new", SPEC, first, lambda done, total: shown.append((done, total)))
    assert np.allclose(first.times, [0.5, 0.6, 0.7, 0.8, 0.9]) and found.rendered == 5
    assert shown == [(i, 5) for i in range(6)]
    expected = np.stack([(torch.arange(48.0).reshape(4, 4, 3) / 64 + t).numpy() for t in first.times])
    assert found.images.dtype == np.float16 and np.array_equal(found.images, expected.astype(np.float16))
    second, shown = Renderer(), []
    again = obtain(tmp_path / "new", SPEC, second, lambda done, total: shown.append((done, total)))
    assert second.times == [] and again.rendered == 0 and shown == [(5, 5)]
    assert np.array_equal(again.images, found.images)
    assert json.loads((tmp_path / "new" / f"{SPEC.key}.json").read_text())["resolution_px"] == 4


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
@pytest.mark.parametrize("broken_after", [0, 1, 4])
def test_goes_on_where_it_stopped(tmp_path: Path, broken_after: int, error: type[BaseException]) -> None:
    whole = get(tmp_path / "whole", Renderer())
    with pytest.raises(error):
        get(tmp_path / "broken", Renderer(broken_after, error))
    assert not (tmp_path / "broken" / f"{SPEC.key}.npy").exists()
    rest = Renderer()
    resumed = get(tmp_path / "broken", rest)
    assert resumed.rendered == len(rest.times) == 5 - broken_after
    assert np.array_equal(resumed.images, whole.images)
    left = {f"{SPEC.key}{ending}" for ending in (".npy", ".json", ".lock")}
    assert all({p.name for p in (tmp_path / name).iterdir()} == left for name in ("whole", "broken"))
    assert (tmp_path / "whole" / f"{SPEC.key}.npy").read_bytes() == (
        tmp_path / "broken" / f"{SPEC.key}.npy"
    ).read_bytes()


def test_an_interruption_after_the_last_image_renders_none_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    move = os.replace

    def refuse(source: Path, target: Path) -> None:
        if target.suffix == ".npy":
            raise KeyboardInterrupt
        move(source, target)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("analysis.reference.os.replace", refuse)
        get(tmp_path, Renderer())
    assert get(tmp_path, Renderer(break_at=0)).rendered == 0


@pytest.mark.parametrize("damage", [b"", b"no array", None])
def test_a_damaged_rest_is_rendered_anew(tmp_path: Path, damage: bytes | None) -> None:
    with pytest.raises(RuntimeError):
        get(tmp_path, Renderer(break_at=3))
    partial = next(tmp_path.glob("*.partial.npy"))
    partial.write_bytes(partial.read_bytes()[:-100] if damage is None else damage)
    with pytest.raises(RuntimeError):
        get(tmp_path, Renderer(break_at=0))
    found = get(tmp_path, Renderer())
    assert found.rendered == 5 and found.images.any((1, 2, 3)).all(), "what the damaged file held is not counted"


def test_an_image_of_another_shape_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"reference: expected images \(4, 4, 3\), got \(4, 5, 3\)"):
        get(tmp_path, lambda time_s: torch.zeros(4, 5, 3))
    np.save(tmp_path / f"{SPEC.key}.npy", np.zeros((2, 2)))
    (tmp_path / f"{SPEC.key}.json").write_text('{"nonfinite": 0}')
    with pytest.raises(ValueError, match="delete the file"):
        get(tmp_path, Renderer())


def test_nonfinite_is_counted_over_an_interruption_and_stored_as_black(tmp_path: Path) -> None:
    values = torch.zeros(4, 4, 3)
    values[0, 0] = torch.tensor([float("nan"), float("inf"), -float("inf")])
    values[1, 1] = torch.tensor([1e9, -3.0, 0.25])
    calls = []

    def render(time_s: float) -> Tensor:
        calls.append(time_s)
        if len(calls) == 3:
            raise RuntimeError
        return values

    with pytest.raises(RuntimeError):
        get(tmp_path, render)
    for found in (get(tmp_path, render), get(tmp_path, render)):
        assert found.nonfinite == 15 and (found.images[:, 0, 0] == 0).all()
        assert (found.images[:, 1, 1] == np.array([65504.0, 0.0, 0.25], np.float16)).all()


def test_two_that_want_the_same_render_it_once(tmp_path: Path) -> None:
    """The second waits for the first, which is held up in the middle."""
    inside, go_on, second = threading.Event(), threading.Event(), Renderer()
    first = Renderer()

    def slow(time_s: float) -> Tensor:
        inside.set()
        assert go_on.wait(20)
        return first(time_s)

    results: list[Reference] = []
    threads = [threading.Thread(target=lambda r=r: results.append(get(tmp_path, r))) for r in (slow, second)]
    threads[0].start()
    assert inside.wait(20)
    threads[1].start()
    threads[1].join(0.1)
    go_on.set()
    for thread in threads:
        thread.join(20)
    assert second.times == [] and sorted(found.rendered for found in results) == [0, 5]


def test_the_key_depends_on_every_field() -> None:
    changed = [
        dataclasses.replace(SPEC, **{f.name: getattr(SPEC, f.name) + ("x" if f.type == "str" else 1)})
        for f in dataclasses.fields(SPEC)
    ]
    keys = {spec.key for spec in (SPEC, *changed)}
    assert len(keys) == len(dataclasses.fields(SPEC)) + 1 and dataclasses.replace(SPEC).key == SPEC.key
    assert (SPEC.shape, SPEC.bytes) == ((5, 4, 4, 3), 480)


@pytest.mark.parametrize("name", ["rate_hz", "count", "resolution_px", "samples_per_axis"])
def test_bad_specifications_name_the_field(name: str) -> None:
    with pytest.raises(ValueError, match=rf"reference {name}: expected a positive number, got 0"):
        dataclasses.replace(SPEC, **{name: 0})


def test_a_full_disk_is_noticed_before_rendering(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.reference.shutil.disk_usage", lambda path: SimpleNamespace(free=SPEC.bytes - 1))
    render = Renderer()
    with pytest.raises(ValueError, match=r"the reference needs .* GB are free"):
        get(tmp_path, render)
    assert render.times == []
