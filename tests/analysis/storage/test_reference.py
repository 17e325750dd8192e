"""References are rendered once, continue where they stopped, and are named by everything that decides their content."""

from __future__ import annotations

import dataclasses
import os
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch import Tensor

from analysis.command.progress import Task
from analysis.storage.journal import Journal
from analysis.storage.reference import Reference, ReferenceSpec, obtain

SPEC = ReferenceSpec(
    "scene", "s" * 8, "r" * 8, start_s=0.5, rate_hz=10.0, count=5, width_px=4, height_px=4, samples_per_axis=2
)


class Renderer:
    """Renders a number that depends on the time, counts calls, and fails at a given image."""

    def __init__(self, break_at: int | None = None, error: type[BaseException] = RuntimeError) -> None:
        self.times: list[float] = []
        self._break_at, self._error = break_at, error

    def __call__(self, time_s: float) -> Tensor:
        if len(self.times) == self._break_at:
            raise self._error
        self.times.append(time_s)
        return torch.arange(48.0).reshape(4, 4, 3) / 64 + time_s


def get(cache: Path, render: Callable[[float], Tensor], spec: ReferenceSpec = SPEC) -> Reference:
    return obtain(cache, spec, render)


def test_renders_every_time_once_and_reuses(tmp_path: Path) -> None:
    first, shown = Renderer(), []
    found = obtain(tmp_path / "new", SPEC, first, Task(show=shown.append))
    assert np.allclose(first.times, [0.5, 0.6, 0.7, 0.8, 0.9]) and found.rendered == 5
    assert shown == list(range(6))
    expected = np.stack([(torch.arange(48.0).reshape(4, 4, 3) / 64 + t).numpy() for t in first.times])
    assert found.images.dtype == np.float16 and np.array_equal(found.images, expected.astype(np.float16))
    second, shown = Renderer(), []
    again = obtain(tmp_path / "new", SPEC, second, Task(show=shown.append))
    assert second.times == [] and again.rendered == 0 and shown == [5]
    assert np.array_equal(again.images, found.images)
    assert Journal(tmp_path / "new" / f"{SPEC.key}.journal").rows()[0]["width_px"] == 4


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
@pytest.mark.parametrize("broken_after", [0, 1, 4])
def test_goes_on_where_it_stopped(tmp_path: Path, broken_after: int, error: type[BaseException]) -> None:
    whole = get(tmp_path / "whole", Renderer())
    with pytest.raises(error):
        get(tmp_path / "broken", Renderer(broken_after, error))
    rest = Renderer()
    resumed = get(tmp_path / "broken", rest)
    assert resumed.rendered == len(rest.times) == 5 - broken_after
    assert np.array_equal(resumed.images, whole.images)
    left = {f"{SPEC.key}{ending}" for ending in (".npy", ".journal", ".lock")}
    assert all({p.name for p in (tmp_path / name).iterdir()} == left for name in ("whole", "broken"))
    assert (tmp_path / "whole" / f"{SPEC.key}.npy").read_bytes() == (
        tmp_path / "broken" / f"{SPEC.key}.npy"
    ).read_bytes()


def damaged(folder: Path, place: int, bit: int = 0) -> None:
    """Flips a bit of the file of images."""
    file = folder / f"{SPEC.key}.npy"
    content = bytearray(file.read_bytes())
    content[place] ^= 1 << bit
    file.write_bytes(content)


IMAGES_FROM = 128  # bytes of the file before the first image
IMAGE_BYTES = 4 * 4 * 3 * 2


@pytest.mark.parametrize("broken_after", [None, 3])
def test_a_damaged_image_is_named_and_rendered_again(
    broken_after: int | None, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    whole = get(tmp_path / "whole", Renderer())
    if broken_after is None:
        get(tmp_path, Renderer())
    else:
        with pytest.raises(RuntimeError):
            get(tmp_path, Renderer(broken_after))
    damaged(tmp_path, IMAGES_FROM + IMAGE_BYTES + 7, bit=5)
    again = Renderer()
    found = get(tmp_path, again)
    assert again.times == ([0.6] if broken_after is None else [0.6, 0.8, 0.9]) and np.array_equal(
        found.images, whole.images
    )
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and f"{SPEC.key}.npy: images 1 are damaged" in error
    assert get(tmp_path, Renderer(0)).rendered == 0 and capsys.readouterr().err == ""


@pytest.mark.parametrize("place", [0, 6, 20, 70, 127])
def test_a_damaged_header_is_named_and_all_is_rendered_again(
    place: int, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """Another dtype, another shape, no array at all."""
    whole = get(tmp_path / "whole", Renderer())
    get(tmp_path, Renderer())
    damaged(tmp_path, place)
    found = get(tmp_path, Renderer())
    assert found.rendered == 5 and np.array_equal(found.images, whole.images)
    assert f"{SPEC.key}.npy: is damaged" in capsys.readouterr().err


@pytest.mark.parametrize(
    "other",
    [
        np.zeros((5, 4, 4, 3), np.uint16),
        np.zeros((5, 4, 4, 3), np.float32),
        np.zeros((5, 3, 4, 4), np.float16),
        np.zeros((5, 4, 3, 4), np.float16),
        np.zeros((2, 2), np.float16),
    ],
)
@pytest.mark.parametrize("broken_after", [None, 3])
def test_an_array_of_another_type_or_shape_is_not_resumed(
    other: np.ndarray, broken_after: int | None, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    whole = get(tmp_path / "whole", Renderer())
    with pytest.raises(RuntimeError):
        get(tmp_path, Renderer(broken_after or 4))
    np.save(tmp_path / f"{SPEC.key}.npy", other)
    found = get(tmp_path, Renderer())
    assert found.rendered == 5 and found.images.shape == SPEC.shape and np.array_equal(found.images, whole.images)
    assert f"{SPEC.key}.npy" in capsys.readouterr().err


@pytest.mark.parametrize("damage", [b"", b"no array", None])
def test_a_damaged_rest_is_rendered_anew(tmp_path: Path, damage: bytes | None) -> None:
    with pytest.raises(RuntimeError):
        get(tmp_path, Renderer(break_at=3))
    file = tmp_path / f"{SPEC.key}.npy"
    file.write_bytes(file.read_bytes()[:-100] if damage is None else damage)
    with pytest.raises(RuntimeError):
        get(tmp_path, Renderer(break_at=0))
    found = get(tmp_path, Renderer())
    assert found.rendered == 5 and found.images.any((1, 2, 3)).all(), "what the damaged file held is not counted"


def test_a_journal_that_claims_more_than_was_rendered_is_not_believed(tmp_path: Path) -> None:
    """Rows of a finished reference beside the images of one that was interrupted."""
    whole = get(tmp_path / "whole", Renderer())
    with pytest.raises(RuntimeError):
        get(tmp_path, Renderer(break_at=3))
    (tmp_path / f"{SPEC.key}.journal").write_bytes((tmp_path / "whole" / f"{SPEC.key}.journal").read_bytes())
    found = get(tmp_path, Renderer())
    assert found.rendered == 2 and np.array_equal(found.images, whole.images)


@pytest.mark.parametrize("with_journal", [True, False])
def test_the_files_of_another_reference_are_not_used(with_journal: bool, tmp_path: Path) -> None:
    other = dataclasses.replace(SPEC, start_s=0.6)
    get(tmp_path, Renderer(), other)
    whole = get(tmp_path / "whole", Renderer())
    get(tmp_path, Renderer())
    for ending in (".npy", ".journal")[: 1 + with_journal]:
        (tmp_path / f"{other.key}{ending}").replace(tmp_path / f"{SPEC.key}{ending}")
    found = get(tmp_path, Renderer())
    assert found.rendered == 5 and np.array_equal(found.images, whole.images)


def test_images_in_each_others_place_are_rendered_again(tmp_path: Path) -> None:
    whole = get(tmp_path / "whole", Renderer())
    get(tmp_path, Renderer())
    images = np.load(tmp_path / f"{SPEC.key}.npy", mmap_mode="r+")
    images[[1, 2]] = images[[2, 1]]
    images.flush()
    found = get(tmp_path, Renderer())
    assert found.rendered == 2 and np.array_equal(found.images, whole.images)


def test_every_image_is_on_the_disk_before_it_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[str] = []
    sync = os.fsync

    def note(handle: int) -> None:
        synced.append(Path(os.readlink(f"/proc/self/fd/{handle}")).suffix)
        sync(handle)

    monkeypatch.setattr(os, "fsync", note)
    get(tmp_path, Renderer())
    assert synced[-10:] == [".npy", ".journal"] * 5


def test_an_image_of_another_shape_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"reference: expected images \(4, 4, 3\), got \(4, 5, 3\)"):
        get(tmp_path, lambda time_s: torch.zeros(4, 5, 3))


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


@pytest.mark.parametrize("name", ["rate_hz", "count", "width_px", "height_px", "samples_per_axis"])
def test_bad_specifications_name_the_field(name: str) -> None:
    with pytest.raises(ValueError, match=rf"reference {name}: expected a positive number, got 0"):
        dataclasses.replace(SPEC, **{name: 0})


def test_a_full_disk_is_noticed_before_rendering(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    little = SimpleNamespace(free=SPEC.bytes - 1)
    monkeypatch.setattr("analysis.storage.reference.shutil.disk_usage", lambda path: little)
    render = Renderer()
    with pytest.raises(ValueError, match=r"the reference needs .* GB are free"):
        get(tmp_path, render)
    assert render.times == []


def test_room_is_taken_before_rendering(tmp_path: Path) -> None:
    """A file with holes would end the process where the disk is full by then."""
    large = dataclasses.replace(SPEC, width_px=64, height_px=64)
    with pytest.raises(RuntimeError):
        get(tmp_path, Renderer(break_at=0), large)
    assert 512 * (tmp_path / f"{large.key}.npy").stat().st_blocks >= large.bytes
