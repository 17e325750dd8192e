"""Properties of USD prims that change the picture and are not read.

Source: OpenUSD documentation, UsdGeom (PointBased, Camera, Gprim), UsdLux (LightAPI, ShadowAPI, ShapingAPI), UsdRender.
"""

from __future__ import annotations

from typing import Any

from scenes.formats.losses import LossReport

_MOTION = "motion within the time of a picture ({})"
_UNREAD = {
    **{name: _MOTION.format(name) for name in ("velocities", "accelerations", "angularVelocities")},
    **{f"exposure{part}": "the exposure of a camera" for part in ("", ":iso", ":time", ":fStop", ":responsivity")},
    **{f"inputs:shadow:{part}": f"shadow:{part} of a light" for part in "color distance falloff falloffGamma".split()},
    "inputs:shaping:focusTint": "shaping:focusTint of a light",
    "inputs:shaping:ies:angleScale": "a profile of a light (IES)",
    "inputs:shaping:ies:normalize": "a profile of a light (IES)",
    "light:filters": "filters of a light",
}
_LINKS = {"lightLink": "which objects a light falls on", "shadowLink": "which objects cast the shadows of a light"}
_HINTS = {"portals": "portals of a light", "clippingRange": "the range of depths of a camera"}
"""Names of properties that are hints to a renderer. A camera cuts nothing, as a light leaves no part out."""


def lose_unread(prim: Any, report: LossReport) -> None:
    """Reports the properties of a prim that differ from their defaults and are not read."""
    for name in prim.GetAuthoredPropertyNames():
        part = name.split(":", 2)[1] if name.startswith("collection:") else ""
        what = _UNREAD.get(name) or _HINTS.get(name) or _LINKS.get(part)
        if name == "orientation" and prim.GetTypeName() != "Mesh":
            what = "a shape whose outside is within"
        if name.startswith("inputs:shaping:cone") and prim.GetTypeName() in (
            "DistantLight",
            "DomeLight",
            "DomeLight_1",
        ):
            what = f"the cone of a {prim.GetTypeName()}"
        if what and _differs(prim, name):
            report.add(prim.GetName(), what, picture=name not in _HINTS)


def lose_settings(stage: Any, report: LossReport) -> None:
    """Reports settings of rendering, whose picture is that of the camera here."""
    for prim in stage.Traverse():
        if prim.GetTypeName() == "RenderSettings":
            report.add(prim.GetName(), "the size and the camera of RenderSettings", "those of the first camera")


def _differs(prim: Any, name: str) -> bool:
    if relation := prim.GetRelationship(name):
        return bool(relation.GetTargets())
    attribute = prim.GetAttribute(name)
    found, default = attribute.Get(), prim.GetPrimDefinition().GetAttributeFallbackValue(name)
    if found is None:
        return attribute.ValueMightBeTimeVarying()
    return len(found) > 0 if isinstance(default, type(None)) and hasattr(found, "__len__") else found != default
