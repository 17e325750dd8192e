"""The hashes that name a reference change with every leaf of a scene and with nothing else."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from analysis.storage.reference import content_hash
from scenes import canonical as c


def whole_scene() -> c.Scene:
    """A bit of everything that a scene can hold, a mesh and a texture shared between instances."""
    rng = np.random.default_rng(2)
    mesh = c.Mesh(rng.random((4, 3), np.float32), np.array([[0, 1, 2], [1, 2, 3]], np.int32), None, np.eye(4, 2), "m")
    picture = c.ImageTexture(rng.random((2, 2, 3), np.float32), source="p")
    checks = c.CheckerboardTexture(picture, c.MixTexture(c.ConstantTexture((0.1, 0.2, 0.3)), picture))
    track = c.RigidTrack(0.0, 0.5, rng.random((2, 3)), np.array([[0.0, 0, 0, 1], [0, 0, 0, 1]]))
    paint, glass = c.Phong(checks, exponent=9.0), c.MixMaterial(c.Glass(thin=True), c.Emissive((1, 2, 3)), picture)
    return c.Scene(
        c.PerspectiveCamera(fov_deg=40.0, track=track),
        (c.Instance(mesh, paint, track=track, name="a"), c.Instance(mesh, glass), c.Instance(c.Cube(), c.Mirror())),
        (c.SpotLight((0, 1, 2), (3, 4, 5), (6, 7, 8), 10.0, 20.0), c.EnvironmentLight(np.ones((1, 1, 3), np.float32))),
        materials={"paint": paint, "glass": glass},
        background=c.EnvironmentLight(np.zeros((1, 2, 3), np.float32), scale=2.0),
    )


def variations(value: Any) -> Iterator[Any]:
    """Copies that differ in one leaf each, however deep it lies, or in the length of one container."""
    if isinstance(value, np.ndarray):
        for place in (0, -1):
            changed = value.copy()
            changed.flat[place] += 1
            yield changed
        yield value.reshape(-1)
        yield value.astype(np.float16)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            for item in variations(getattr(value, field.name)):
                changed = copy.copy(value)
                object.__setattr__(changed, field.name, item)  # past the checks: only the hash is of interest
                yield changed
    elif isinstance(value, Mapping):
        yield {**value, "new": 0}
        for key in value:
            yield from ({**value, key: item} for item in variations(value[key]))
    elif isinstance(value, tuple):
        yield (*value, None)
        for number, entry in enumerate(value):
            yield from ((*value[:number], item, *value[number + 1 :]) for item in variations(entry))
    elif isinstance(value, float):
        yield np.nextafter(value, np.inf).item()
    else:
        yield {bool: lambda: not value, int: lambda: value + 1, str: lambda: value + "x"}.get(
            type(value), lambda: 0.0
        )()


def test_every_leaf_of_a_scene_changes_its_hash() -> None:
    scene = whole_scene()
    hashes = [content_hash(scene), *(content_hash(changed) for changed in variations(scene))]
    assert len(hashes) > 250 and len(set(hashes)) == len(hashes)


def test_the_hash_is_stable() -> None:
    """Neither identity, nor sharing, nor the order of a mapping, nor the process decides it."""
    scene = whole_scene()
    unshared = dataclasses.replace(
        copy.deepcopy(scene),
        instances=tuple(copy.deepcopy(instance) for instance in scene.instances),
        materials=dict(reversed(scene.materials.items())),
    )
    assert content_hash(scene) == content_hash(whole_scene()) == content_hash(unshared)
    pinned = "f6292ecc8f3ec941"  # a change of it makes every reference on disk unknown
    assert content_hash((1, 2.5, "a", None))[:16] == content_hash([1, 2.5, "a", None])[:16] == pinned
