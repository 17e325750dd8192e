"""Cameras and lights of a glTF file.

Intensities are taken as they are, as by the Khronos sample renderer: a light of 1 candela has a radiant intensity of 1.

Source: Khronos Group, "glTF 2.0 specification", section 3.10; extension KHR_lights_punctual.
"""

from __future__ import annotations

import math

import numpy as np

from scenes.canonical import (
    DirectionalLight,
    Light,
    Matrix,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    RigidTrack,
    SpotLight,
)
from scenes.formats.appearance.spectra import rgb
from scenes.formats.losses import LossReport
from scenes.models.gltf_data import GltfData
from scenes.models.gltf_records import LIGHT
from scenes.models.json_records import misplaced, require
from scenes.models.model import ModelCamera, axis_of, shorter_fov_deg, unscaled

_SHARP = 1e-6  # relative width of the edge of a spot that has none


def camera_at_node(
    data: GltfData, number: int, matrix: Matrix, track: RigidTrack | None, report: LossReport
) -> ModelCamera:
    """A camera at a node with this transform and motion; one that leaves its aspect to the picture has a square one.

    Raises:
        SceneError: the camera has no positive extent.
    """
    given = data.at("cameras", number)
    kind = given.get("type", "perspective")
    place, lens = f"cameras[{number}].{kind}", given.get(kind)
    if lens is None:
        raise misplaced(place, "an object", "none")
    if kind == "orthographic":
        wide, high = abs(float(lens["xmag"])), abs(float(lens["ymag"]))
        if not min(wide, high) > 0.0:
            raise misplaced(place, "an xmag and a ymag other than 0", f"{wide:g} and {high:g}")
        return ModelCamera(OrthographicCamera(unscaled(matrix), min(wide, high), track), wide / high)
    if "aspectRatio" not in lens:
        report.hint(place, "no aspectRatio, so that the field of view is along the height of any picture", "a square")
    aspect, fov = float(lens.get("aspectRatio", 1.0)), float(lens["yfov"])
    if not 0.0 < fov < math.pi:
        raise misplaced(f"{place}.yfov", "an angle in (0, π)", f"{fov:g}")
    if not aspect > 0.0:
        raise misplaced(f"{place}.aspectRatio", "a positive number", f"{aspect:g}")
    return ModelCamera(PerspectiveCamera(unscaled(matrix), shorter_fov_deg(fov, aspect), track=track), aspect)


def light_at_node(data: GltfData, number: int, matrix: Matrix, where: str, report: LossReport) -> Light | None:
    """The light of the extension KHR_lights_punctual at the node of this number with this transform.

    Spots fall off as ``x²`` in the cosine, as the extension recommends.

    Raises:
        SceneError: there is no such light, or one of its values is not what the extension has there.
    """
    lights = data.json.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    chosen = data.at("nodes", number)["extensions"]["KHR_lights_punctual"]["light"]
    if chosen >= len(lights):
        named = f"nodes[{number}].extensions.KHR_lights_punctual.light"
        raise misplaced(named, f"an index of lights below {len(lights)}", chosen)
    given, place = lights[chosen], f"extensions.KHR_lights_punctual.lights[{chosen}]"
    require(given, LIGHT, place)
    color = np.asarray(given.get("color", (1.0, 1.0, 1.0)), np.float64) * float(given.get("intensity", 1.0))
    strength, kind = rgb(np.maximum(color, 0.0)), given["type"]
    if "range" in given:
        report.add(where, "the range of a light", "no limit")
    if kind == "directional":
        return DirectionalLight(axis_of(matrix, 2), strength)
    x, y, z = (float(part) for part in matrix[:3, 3])
    if kind == "point":
        return PointLight((x, y, z), strength)
    if kind != "spot":
        report.add(where, f"a light of type {kind}")
        return None
    spot, along = given.get("spot", {}), axis_of(matrix, 2)
    outer_deg = math.degrees(float(spot.get("outerConeAngle", math.pi / 4.0)))
    inner_deg = math.degrees(float(spot.get("innerConeAngle", 0.0)))
    if not (0.0 <= inner_deg and 0.0 < outer_deg <= 90.0 + 1e-5):
        got = f"{math.radians(inner_deg):g} and {math.radians(outer_deg):g}"
        raise misplaced(f"{place}.spot", "cone angles 0 <= inner and 0 < outer <= π/2", got)
    if inner_deg >= outer_deg:
        report.add(where, "a spot whose inner cone is as wide as its outer cone", "one that is slightly narrower")
        inner_deg = outer_deg * (1.0 - _SHARP)
    target = x + along[0], y + along[1], z + along[2]
    return SpotLight((x, y, z), target, strength, inner_deg, min(outer_deg, 90.0), "quadratic")
