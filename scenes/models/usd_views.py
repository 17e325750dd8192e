"""Cameras and lights of a USD file.

Source: OpenUSD documentation, UsdGeomCamera and UsdLux (LightAPI, and the light of each kind).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import arctan, norm, power, product, sin
from scenes.canonical import (
    ConstantTexture,
    DirectionalLight,
    Disk,
    EnvironmentLight,
    Light,
    Matrix,
    Matte,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    RigidTrack,
    SceneError,
    Shape,
    Sphere,
    SpotLight,
)
from scenes.formats.appearance.spectra import rgb
from scenes.formats.losses import LossReport
from scenes.models.model import ModelCamera, axis_of, shorter_fov_deg, unscaled
from scenes.models.usd_library import UsdGeom, UsdLux
from scenes.models.usd_textures import Pictures, Reading
from scenes.models.usd_values import finite
from scenes.viewing import turned_up

LAMP = Matte(ConstantTexture((0.0, 0.0, 0.0)))
"""Material of lamps, which reflect nothing."""

KINDS = ("DistantLight", "SphereLight", "DiskLight", "RectLight", "DomeLight", "DomeLight_1")
_IDENTITY = (1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 0.0)


def camera_of(prim: Any, code: Any, matrix: Matrix, track: RigidTrack | None, report: LossReport) -> ModelCamera:
    """A camera with this transform and motion.

    Raises:
        SceneError: apertures or focal length are not positive, or values are not finite.
    """
    lens = UsdGeom.Camera(prim).GetCamera(code)
    wide, high = lens.horizontalAperture, lens.verticalAperture
    if not all(0.0 < size < math.inf for size in (wide, high, lens.focalLength)):
        raise SceneError(f"cannot be read: camera {prim.GetName()}: expected positive apertures and focal length")
    offsets = lens.horizontalApertureOffset, lens.verticalApertureOffset
    finite((*offsets, lens.fStop, lens.focusDistance), f"camera {prim.GetName()}: lens")
    if tuple(lens.clippingPlanes):
        report.add(prim.GetName(), "clipping planes of a camera")
    placed, tenth = unscaled(matrix), 0.1  # apertures and focal length are in tenths of a scene unit
    shift = offsets[0] / wide, offsets[1] / high
    if str(lens.projection).endswith("Orthographic"):
        if shift != (0.0, 0.0):
            report.add(prim.GetName(), "a picture off the viewing direction", "one about it")
        return ModelCamera(OrthographicCamera(placed, tenth * min(wide, high) / 2.0, track), wide / high)
    fov_deg = shorter_fov_deg(2.0 * float(arctan(high / (2.0 * lens.focalLength))), wide / high)
    focus = lens.focusDistance if lens.focusDistance > 0.0 else 1.0
    sharp = lens.fStop <= 0.0 or lens.focusDistance <= 0.0
    radius = 0.0 if sharp else tenth * lens.focalLength / (2.0 * lens.fStop)
    rate = float(prim.GetStage().GetTimeCodesPerSecond()) or 24.0
    opened, closed = (float(_of(prim, f"shutter:{one}", code, 0.0)) / rate for one in ("open", "close"))
    return ModelCamera(
        PerspectiveCamera(placed, fov_deg, radius, focus, track, (opened, max(opened, closed)), shift), wide / high
    )


def light_of(
    prim: Any, code: Any, matrix: Matrix, pictures: Pictures, up_is_z: bool, report: LossReport
) -> tuple[Light | None, tuple[Shape, Matrix, tuple[float, float, float]] | None]:
    """A light without an area; or the shape, the transform and the radiance of a lamp. Both None if there is no light.

    Raises:
        SceneError: one of its values or its strength is not finite, or its picture cannot be read.
    """
    name, kind = prim.GetName(), prim.GetTypeName()
    if kind not in KINDS:
        report.add(name, f"a light of kind {kind}")
        return None, None
    radiance = _radiance(prim, code, report)
    if not np.any(radiance > 0.0):
        return None, None
    if kind.startswith("DomeLight"):
        return _dome(prim, code, matrix, radiance, pictures, up_is_z, report), None
    normalized = bool(_value(prim, "normalize", code, False))
    if kind == "DistantLight":
        half_deg = min(max(float(_value(prim, "angle", code, 0.53)) / 2.0, 0.0), 90.0)
        solid = math.pi * float(sin(math.radians(half_deg))) ** 2
        shown = radiance if normalized or solid == 0.0 else radiance * solid
        return DirectionalLight(axis_of(matrix, 2), rgb(shown), 2.0 * half_deg), None
    shape, local, area = _lamp(prim, kind, code, matrix)
    if not area > 0.0:
        report.add(name, "a light without extent")
        return None, None
    if normalized:
        radiance = radiance / area
    point = kind == "SphereLight" and bool(_value(prim, "treatAsPoint", None, False))
    cone_deg = float(_value(prim, "shaping:cone:angle", code, 180.0))
    if 90.0 <= cone_deg < 180.0 and kind == "SphereLight":
        # programs write 90, the usual value, to lamps without a cone
        what, became = f"a cone of {cone_deg:g} degrees of a SphereLight", "light to all sides"
        report.add(name, what, became, picture=cone_deg != 90.0)
    if cone_deg < 90.0:
        if not point:
            report.add(name, f"the extent of a {kind} with a cone", "a spot")
        return _spot(prim, code, matrix, radiance * area / (4.0 if kind == "SphereLight" else 1.0)), None
    if point:
        x, y, z = (float(part) for part in matrix[:3, 3])
        return PointLight((x, y, z), rgb(radiance * area / 4.0)), None
    if kind == "RectLight" and _value(prim, "texture:file", code, None):
        report.add(name, "a texture of a lamp")
    return None, (shape, product(matrix, local), rgb(radiance))


def _value(prim: Any, name: str, code: Any, rest: Any) -> Any:
    return _of(prim, f"inputs:{name}" if name != "treatAsPoint" else name, code, rest)


def _of(prim: Any, name: str, code: Any, rest: Any) -> Any:
    """The value of an attribute."""
    attribute = prim.GetAttribute(name)
    found = attribute.Get() if attribute and code is None else attribute.Get(code) if attribute else None
    return rest if found is None else finite(found, attribute.GetPath())


def _radiance(prim: Any, code: Any, report: LossReport) -> NDArray[np.float64]:
    """Colour times intensity times 2 to the exposure, and the colour of its temperature."""
    exposure = min(float(_value(prim, "exposure", code, 0.0)), 99.0)
    strength = float(_value(prim, "intensity", code, 1.0)) * 2.0**exposure
    color = np.array(_value(prim, "color", code, (1.0, 1.0, 1.0)), np.float64)
    if _value(prim, "enableColorTemperature", code, False):
        kelvin = float(_value(prim, "colorTemperature", code, 6500.0))
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))
    if not (np.abs(color * strength) <= np.finfo(np.float32).max).all():
        raise SceneError(f"cannot be read: light {prim.GetName()}: expected a finite strength")
    for name, rest in (("diffuse", 1.0), ("specular", 1.0), ("shaping:focus", 0.0), ("shadow:enable", True)):
        if _value(prim, name, code, rest) != rest:
            report.add(prim.GetName(), f"{name} of a light")
    if _value(prim, "shaping:ies:file", code, None):
        report.add(prim.GetName(), "a profile of a light (IES)")
    return np.maximum(color * strength, 0.0)


def glow_of(prim: Any, code: Any, report: LossReport) -> bool:
    """Whether a shape with the quality of a light shines as its material does, which it then does without it."""
    mode = str(_of(prim, "light:materialSyncMode", None, "noMaterialResponse"))
    plain = not bool(_value(prim, "normalize", code, False)) and bool((_radiance(prim, code, report) == 1.0).all())
    return mode == "materialGlowTintsLight" and plain


def _lamp(prim: Any, kind: str, code: Any, matrix: Matrix) -> tuple[Shape, Matrix, float]:
    """Shape, local transform and area in the world of a lamp; flat ones emit along -z."""
    axes = [norm(matrix[:3, axis]) for axis in range(3)]
    flat = np.diag([-1.0, 1.0, -1.0, 1.0])
    if kind == "SphereLight":
        radius = max(float(_value(prim, "radius", code, 0.5)), 1e-6)
        size = radius * float(power(np.prod(axes), 1.0 / 3.0))
        return Sphere(radius), np.eye(4), 4.0 * math.pi * size * size
    if kind == "DiskLight":
        radius = max(float(_value(prim, "radius", code, 0.5)), 1e-6)
        return Disk(radius), flat, math.pi * radius * radius * axes[0] * axes[1]
    wide, high = (max(float(_value(prim, name, code, 1.0)), 1e-6) for name in ("width", "height"))
    return Rectangle(), product(flat, np.diag([wide / 2.0, high / 2.0, 1.0, 1.0])), wide * high * axes[0] * axes[1]


def _spot(prim: Any, code: Any, matrix: Matrix, intensity: NDArray[np.float64]) -> SpotLight:
    """A lamp with a cone as a spot without an area, with its intensity on the axis."""
    outer_deg = max(float(_value(prim, "shaping:cone:angle", code, 90.0)), 1e-3)
    softness = min(max(float(_value(prim, "shaping:cone:softness", code, 0.0)), 0.0), 1.0)
    (x, y, z), along = (float(part) for part in matrix[:3, 3]), axis_of(matrix, 2)
    target = x + along[0], y + along[1], z + along[2]
    return SpotLight((x, y, z), target, rgb(intensity), outer_deg * min(1.0 - softness, 0.999), outer_deg)


def _dome(
    prim: Any, code: Any, matrix: Matrix, radiance: NDArray[np.float64], pictures: Pictures, up_is_z: bool,
    report: LossReport,
) -> EnvironmentLight:  # fmt: skip
    """An environment: its top is along +y, or for a DomeLight_1 along the pole that it names."""
    turn = unscaled(matrix)
    turn[:3, 3] = 0.0
    pole = str(prim.GetAttribute("poleAxis").Get() or "scene") if prim.GetTypeName() == "DomeLight_1" else "Y"
    if pole == "Z" or (pole == "scene" and up_is_z):
        turn = product(turn, product(turned_up("z"), turned_up("y").T))
    image = np.ones((1, 1, 3), np.float32)
    file = _value(prim, "texture:file", code, None)
    if file is not None and file.path:
        name = str(prim.GetName())
        path = file.resolvedPath or pictures.sources.known(file.path, name, report, "the picture", "even light")
        if path is not None and str(_value(prim, "texture:format", code, "automatic")) not in ("automatic", "latlong"):
            report.add(prim.GetName(), "the layout of an environment map", "latitude and longitude")
        space = prim.GetAttribute("inputs:texture:file").GetColorSpace()
        space = space if space in ("raw", "sRGB") else "auto"
        if path is not None:
            image = pictures.values(Reading(str(path), "rgb", space, *_IDENTITY, ()))
    return EnvironmentLight((image * radiance.astype(np.float32)).astype(np.float32), turn, source=str(prim.GetName()))
