"""Arrays that cross into native code: invalid ones are refused by name, before anything is written."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp
from torch import Tensor

from renderer.compute.launching import address, shared
from renderer.stages.control import compiled_stages
from tests.oracles import runs
from tests.oracles.batches import make_batch
from tests.renderer.stages.builders import small
from tsar.cache import EMPTY, FrameletCache
from tsar.clock import StageTimer
from tsar.tiling import uniform
from tsar.types import Errors, FrameletBatch

ELEMENTS = 64**2
CONFIG = small(batch_size=16, sdf_side=64, resolution_px=128)


def a_batch(count: int) -> FrameletBatch:
    """The first tiles of level 2."""
    return make_batch(uniform(2), torch.arange(count), 0.0, 0, CONFIG)


def spoilt(values: Tensor) -> list[tuple[str, Tensor]]:
    """An array in every form that native code would misread, and the message about it."""
    other = torch.float32 if values.dtype is torch.float64 else torch.float64
    return [
        (str(other), values.to(other)),
        (rf"got shape \({len(values) - 1}", values[:-1]),
        (rf"got shape \({len(values) + 1}", torch.cat((values, values[:1]))),
        ("with strides", torch.stack((values, values), -1)[..., 0]),
        ("on meta", values.to("meta")),
    ]


@pytest.mark.parametrize("way", range(5))
def test_what_native_code_would_misread_is_refused(way: int) -> None:
    message, wrong = spoilt(torch.zeros(7, dtype=torch.float64))[way]
    expected = r"^credit: expected 7 contiguous elements of torch\.float64 on cpu, got shape .*"
    with pytest.raises(ValueError, match=expected + message if "shape" not in message else message):
        address("credit", wrong, torch.float64, 7)


def test_numpy_arrays_are_refused_alike() -> None:
    values = np.zeros(3)
    assert address("sums", values, torch.float64, 3) == values.ctypes.data
    with pytest.raises(ValueError, match=r"sums: expected 2 .* of torch\.float64"):
        address("sums", values, torch.float64, 2)
    with pytest.raises(ValueError, match=r"sums: expected 3 .* of torch\.int64"):
        address("sums", values, torch.int64, 3)


def test_memory_is_shared_or_refused() -> None:
    """Warp itself would fill a copy that is never read."""
    points = np.zeros((4, 3), np.float32)
    assert shared(points, wp.vec3).ptr == points.ctypes.data
    for wrong in (points.astype(np.float64), np.zeros((4, 6), np.float32)[:, ::2], np.zeros((8, 3), np.float32)[::2]):
        with pytest.raises(ValueError, match="expected contiguous elements of vec3"):
            shared(wrong, wp.vec3)


@pytest.mark.parametrize("way", [0, 1, 2, 3])
@pytest.mark.parametrize("name", ["densities.spatial", "densities.temporal", "history"])
def test_a_decision_refuses_other_fields(name: str, way: int) -> None:
    stages, state = compiled_stages(CONFIG), runs.made("thesis", CONFIG).start()
    fields = {
        "densities.spatial": state.densities.spatial,
        "densities.temporal": state.densities.temporal,
        "history": state.due.history,
    }
    fields[name] = spoilt(fields[name])[way][1]
    densities = copy.copy(state.densities)
    object.__setattr__(densities, "spatial", fields["densities.spatial"])
    object.__setattr__(densities, "temporal", fields["densities.temporal"])
    none = Errors(*torch.zeros(2, ELEMENTS).unbind(0))
    with pytest.raises(ValueError, match=rf"^{name}: expected {ELEMENTS} contiguous elements of torch\.float64"):
        stages.decide(densities, none, fields["history"], CONFIG, StageTimer())
    if name == "history":
        return
    newest_s = torch.zeros(4**CONFIG.level_max, dtype=torch.float64)
    with pytest.raises(ValueError, match=f"^{name}: expected"):
        stages.account(densities, none, newest_s, CONFIG)


@pytest.mark.parametrize("count", [4, ELEMENTS - 1])
def test_a_decision_refuses_errors_of_another_length(count: int) -> None:
    stages, state = compiled_stages(CONFIG), runs.made("thesis", CONFIG).start()
    with pytest.raises(ValueError, match=f"^errors.temporal: expected {ELEMENTS} "):
        errors = Errors(torch.zeros(ELEMENTS), torch.zeros(ELEMENTS))
        object.__setattr__(errors, "temporal", torch.zeros(count))
        stages.decide(state.densities, errors, state.due.history, CONFIG, StageTimer())


def test_an_account_refuses_another_map() -> None:
    stages, state = compiled_stages(CONFIG), runs.made("thesis", CONFIG).start()
    none = Errors(*torch.zeros(2, ELEMENTS).unbind(0))
    with pytest.raises(ValueError, match=r"^newest_s: expected \d+ contiguous"):
        stages.account(state.densities, none, torch.zeros(2, 2, dtype=torch.float64), CONFIG)


@pytest.mark.parametrize("name", ["level", "index", "time_s", "color"])
def test_a_batch_with_another_array_leaves_the_cache_alone(name: str) -> None:
    stages, cache = compiled_stages(CONFIG), FrameletCache(CONFIG)
    batch, color = a_batch(4), torch.zeros(4, 256, 3)
    wrong = {
        "level": {"level": batch.level.to(torch.int32)},
        "index": {"index": torch.arange(3)},
        "time_s": {"time_s": torch.zeros(3, 256, dtype=torch.float64)},
        "color": {},
    }[name]
    batch = copy.copy(batch)
    for field, value in wrong.items():
        object.__setattr__(batch, field, value)
    color = color[:, :255] if name == "color" else color
    with pytest.raises(ValueError, match=rf"^(batch\.)?{name}: expected"):
        stages.observe(batch, color, cache, CONFIG, StageTimer())
    assert (cache.level == EMPTY).all()


@pytest.mark.parametrize("name", ["level", "index", "time_s", "dead", "color", "coefficients", "slot_of_node"])
def test_a_cache_of_another_configuration_is_refused(name: str) -> None:
    """Also an array that was valid at its first use."""
    stages, cache = compiled_stages(CONFIG), FrameletCache(CONFIG)
    stages.reconstruct(cache, CONFIG, 1.0)
    batch = a_batch(4)
    stages.observe(batch, torch.zeros(4, 256, 3), cache, CONFIG, StageTimer())
    larger = FrameletCache(replace(CONFIG, cache_size=4096, resolution_px=256))
    setattr(cache, name, getattr(larger, name))
    with pytest.raises(ValueError, match=rf"^cache\.{name}: expected"):
        stages.observe(batch, torch.zeros(4, 256, 3), cache, CONFIG, StageTimer())
    if name not in ("coefficients", "slot_of_node"):
        with pytest.raises(ValueError, match=rf"^cache\.{name}: expected"):
            stages.reconstruct(cache, CONFIG, 1.0)


def test_a_cache_that_is_given_another_tensor_is_read_anew() -> None:
    """A launch recorded for it would read freed memory."""
    stages, cache = compiled_stages(CONFIG), FrameletCache(CONFIG)
    batch = a_batch(16)
    stages.observe(batch, torch.ones(16, 256, 3), cache, CONFIG, StageTimer())
    stages.reconstruct(cache, CONFIG, 1.0)
    cache.color = torch.full_like(cache.color, 0.25)
    image = stages.reconstruct(cache, CONFIG, 1.0).image
    torch.testing.assert_close(image, torch.full_like(image, 0.25))
