"""Media of a scene: which there are, and the scene without them for formats that have none."""

from __future__ import annotations

import dataclasses

import numpy as np

from scenes.canonical import Glass, Instance, Medium, Rgb, Scene, SceneError
from scenes.formats.appearance.mixtures import is_nothing
from scenes.formats.appearance.spectra import rgb
from scenes.formats.losses import LossReport

VACUUM = Medium()
"""Vacuum by name, which the border of a hole within a medium needs: a surface without media is no border."""


def plain(medium: Medium) -> Medium:
    """The coefficients of a medium alone."""
    return Medium(medium.absorption, medium.scattering, medium.g)


def _is_vacuum(medium: Medium | None) -> bool:
    return medium is None or max(medium.extinction) == 0.0


def settled(scene: Scene, report: LossReport) -> Scene:
    """The scene whose vacuum is None, except at the borders of holes within media. Invisible surfaces that are no
    borders are left out."""
    media = media_of(scene)
    if not media:
        return scene
    filled = not all(map(_is_vacuum, media))
    kept = []
    for one in scene.instances:
        sides = one.interior, one.exterior
        if sides != (None, None):
            found = [None if _is_vacuum(side) else side for side in sides]
            hole = filled and found == [None, None]
            one = dataclasses.replace(one, interior=VACUUM if hole else found[0], exterior=found[1])
            if one.interior is None and one.exterior is None and is_nothing(one.material) and one.emission is None:
                report.hint(one.name or "shape", "the border of a medium, which is invisible")
                continue
        kept.append(one)
    around = None if _is_vacuum(scene.medium) else scene.medium
    return dataclasses.replace(scene, instances=tuple(kept), medium=around)


def made_medium(absorption: Rgb, scattering: Rgb, g: float, where: str, factor: float = 1.0) -> Medium:
    """A medium whose coefficients are multiplied by a factor.

    Raises:
        SceneError: a coefficient is negative or not finite, or ``g`` is out of range; the message gives the place.
    """
    try:
        return Medium(rgb(factor * np.array(absorption)), rgb(factor * np.array(scattering)), g)
    except SceneError as error:
        raise SceneError(f"{where}: {error}") from None


def media_of(scene: Scene) -> list[Medium]:
    """The media of a scene, each once, in the order of their first use; that of the camera is the first."""
    found = [scene.medium, *(side for one in scene.instances for side in (one.interior, one.exterior))]
    return list(dict.fromkeys(medium for medium in found if medium is not None))


def without_media(scene: Scene, report: LossReport, within_glass: bool = False) -> Scene:
    """The scene without media and without invisible surfaces, for formats that have neither; media are reported, except
    those ``within_glass``, which can be kept."""
    if scene.medium is not None:
        report.add("camera", f"a medium around the camera ({_named(scene.medium)})")
    kept = tuple(bare for one in scene.instances if (bare := _bare(one, report, within_glass)) is not None)
    return dataclasses.replace(scene, instances=kept, medium=None)


def absorbing_within(scene: Scene, report: LossReport) -> Scene:
    """The scene with the media that absorb within glass, for formats that have no others; these are reported.

    An invisible surface about such a medium becomes glass of the index 1, which is invisible, too.
    """
    clear = Glass(ior=1.0)
    kept = []
    for one in scene.instances:
        if one.interior is None or not (is_nothing(one.material) or _solid(one)) or one.emission is not None:
            kept.append(one)
            continue
        medium = Medium(one.interior.absorption) if max(one.interior.absorption) > 0.0 else None
        if one.interior.scatters:
            became = "left out" if medium is None else "its absorption alone"
            report.add(one.name or "shape", "a medium inside a surface (scattering)", became)
        material = clear if is_nothing(one.material) and medium is not None else one.material
        kept.append(dataclasses.replace(one, material=material, interior=medium))
    return without_media(dataclasses.replace(scene, instances=tuple(kept)), report, within_glass=True)


def as_drawn_by(scene: Scene, integrator: str, where: str, report: LossReport) -> Scene:
    """The scene of a file whose integrator does not draw media, so that the picture stays the same."""
    if not media_of(scene):
        return scene
    report.hint(where, f"media, which the integrator {integrator!r} does not draw")
    return without_media(scene, LossReport())


def _bare(instance: Instance, report: LossReport, within_glass: bool) -> Instance | None:
    where = instance.name or "shape"
    kept = instance.interior if within_glass and _solid(instance) and instance.emission is None else None
    for side, medium in (("inside", None if kept else instance.interior), ("outside", instance.exterior)):
        if medium is not None and not _is_vacuum(medium):
            report.add(where, f"a medium {side} a surface ({_named(medium)})")
    if is_nothing(instance.material) and instance.emission is None:
        return None
    if instance.interior is kept and instance.exterior is None:
        return instance
    return dataclasses.replace(instance, interior=kept, exterior=None)


def _solid(instance: Instance) -> bool:
    return isinstance(instance.material, Glass) and not instance.material.thin


def _named(medium: Medium) -> str:
    return "scattering" if medium.scatters else "absorbing"
