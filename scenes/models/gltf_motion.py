"""Animations of a glTF file: transforms of its nodes and weights of its morph targets over time.

Source: Khronos Group, "glTF 2.0 specification", section 3.11 and appendix C.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.animation import continuous_quaternions
from scenes.arithmetic import affine, rotation_between
from scenes.formats.losses import LossReport
from scenes.models.gltf_data import GltfData
from scenes.models.json_records import misplaced, require
from scenes.models.motion import Poses, uniform_times

_REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


def local_poses(values: dict[str, Any], count: int = 1) -> Poses:
    """Transforms from a node to its parent, from its properties: each one value, or one for each key."""
    found = np.zeros((count, 4, 4))
    found[:] = np.eye(4)
    if "matrix" in values:
        given = np.asarray(values["matrix"], np.float64).reshape(4, 4).T
        plain = affine(given)
        found[:] = given if plain is None else plain  # a perspective is refused where the node is known
        return found
    move, turn, scale = (np.asarray(values.get(name, rest), np.float64) for name, rest in _REST.items())
    if turn.any():
        found[:, :3, :3] = Rotation.from_quat(turn).as_matrix()
    found[:, :3, :3] *= scale[..., None, :]
    found[:, :3, 3] = move
    return found


_TYPES = {"rotation": "VEC4", "weights": "SCALAR"}  # of values; those of others are VEC3
_Channel = tuple[NDArray[np.float64], NDArray[np.float64], str, str]
"""Times of keys, their values, the interpolation, and the JSON path of the sampler."""


class GltfMotion:
    """The first animation of a file, at uniform times.

    Attributes:
        times_s: times of the keys, seconds; empty if nothing moves.
    """

    def __init__(self, data: GltfData, report: LossReport) -> None:
        """Reads the channels.

        Raises:
            SceneError: a channel cannot be read, or the motion needs more than 65,536 keys.
        """
        self.data, self.report, stem = data, report, data.sources.path.stem
        self._channels: dict[int, dict[str, _Channel]] = {}
        count = len(data.items("animations"))
        if count > 1:
            report.add(stem, f"animations after the first ({count - 1})")
        animation = data.at("animations", 0) if count else {}
        for number, channel in enumerate(animation.get("channels", ())):
            target = channel["target"]
            if "node" not in target or target.get("path") not in (*_REST, "weights"):
                report.add(stem, f"an animation of {target.get('path', 'nothing')}")
                continue
            samplers = animation.get("samplers", ())
            if channel["sampler"] >= len(samplers):
                place = f"animations[0].channels[{number}].sampler"
                raise misplaced(place, f"an index of samplers below {len(samplers)}", channel["sampler"])
            read = self._sampler(samplers[channel["sampler"]], target["path"], channel["sampler"])
            self._channels.setdefault(target["node"], {})[target["path"]] = read
        spans = [keys for channels in self._channels.values() for keys, *_ in channels.values()]
        self.times_s = uniform_times(max((float(keys[-1]) for keys in spans), default=0.0), "animations[0]")

    def _sampler(self, sampler: dict[str, Any], path: str, number: int) -> _Channel:
        """Keys, values and interpolation of a sampler, and its JSON path.

        Raises:
            SceneError: they do not belong together.
        """
        place = f"animations[0].samplers[{number}]"
        require(sampler, self.data.records.sampler, place)
        kind = sampler.get("interpolation", "LINEAR")
        keys = self.data.numbers(sampler["input"], "times", ("SCALAR",))[:, 0]
        values = self.data.numbers(sampler["output"], f"a {path}", (_TYPES.get(path, "VEC3"),))
        each = 3 if kind == "CUBICSPLINE" else 1
        if not len(keys):
            raise misplaced(f"{place}.input", "at least one time", "none")
        if path == "weights" and len(values) and not len(values) % (len(keys) * each):
            values = values.reshape(len(keys) * each, -1)  # one for each target
        if len(values) != len(keys) * each:
            raise misplaced(f"{place}.output", f"{each} elements for each of {len(keys)} times", len(values))
        if not (np.diff(keys) > 0.0).all():
            raise misplaced(f"{place}.input", "times that increase", "one that does not")
        if path == "rotation" and not values[each // 2 :: each].any(axis=1).all():
            raise misplaced(f"{place}.output", "quaternions other than zero", "zero")
        return keys, values, kind, place

    def moves(self, number: int) -> bool:
        """Whether the animation changes the transform of a node over time."""
        return len(self.times_s) > 0 and not self._channels.get(number, {}).keys().isdisjoint(_REST)

    def poses(self, number: int, times_s: NDArray[np.float64]) -> Poses:
        """Transforms from a node to its parent at these times; those of the node itself where it is not animated."""
        node = self.data.at("nodes", number)
        moved = {
            path: _sampled(path, channel, times_s)
            for path, channel in self._channels.get(number, {}).items()
            if path in _REST
        }
        own = {name: value for name, value in node.items() if not moved or name != "matrix"}
        return local_poses(own | moved, len(times_s))

    def weights(self, number: int, time_s: float) -> NDArray[np.float64] | None:
        """Weights of the morph targets at a node at a time; None if they are not animated."""
        channel = self._channels.get(number, {}).get("weights")
        return None if channel is None else _sampled("weights", channel, np.array([time_s]))[0]


def _sampled(path: str, channel: _Channel, times_s: NDArray) -> NDArray:
    """Values of a channel at times; the first and last keys hold beyond them.

    Raises:
        SceneError: a spline of quaternions goes through zero.
    """
    keys, values, kind, place = channel
    at = np.clip(times_s, keys[0], keys[-1])
    low = np.clip(np.searchsorted(keys, at, side="right") - 1, 0, max(len(keys) - 2, 0))
    if kind == "STEP":
        return values[np.searchsorted(keys, at, side="right") - 1]
    if kind == "CUBICSPLINE":
        values = values.reshape(len(keys), 3, -1)
    if len(keys) == 1:
        return np.repeat(values[:, 1] if kind == "CUBICSPLINE" else values, len(at), axis=0)
    if kind == "CUBICSPLINE":
        span = (keys[low + 1] - keys[low])[:, None]
        u = (at - keys[low])[:, None] / span
        rest = 1.0 - u
        found = rest * rest * (1.0 + 2.0 * u) * values[low, 1] + u * u * (1.0 + 2.0 * rest) * values[low + 1, 1]
        found = found + span * u * rest * (rest * values[low, 2] - u * values[low + 1, 0])
        if path != "rotation":
            return found
        norms = np.linalg.norm(found, axis=1, keepdims=True)
        if not (norms > 0.0).all():
            raise misplaced(f"{place}.output", "a spline of quaternions other than zero", "one through zero")
        return found / norms
    share = (at - keys[low]) / (keys[low + 1] - keys[low])
    if path == "rotation":
        values = continuous_quaternions(values / np.linalg.norm(values, axis=1, keepdims=True))
        return rotation_between(values[low], values[low + 1], share).as_quat()
    return values[low] + share[:, None] * (values[low + 1] - values[low])
