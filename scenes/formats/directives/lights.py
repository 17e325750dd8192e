"""Lights of directive files, converted to the canonical scene."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import norm, product
from scenes.canonical import DirectionalLight, EnvironmentLight, PointLight, Rgb, SceneError, SpotLight
from scenes.canonical.values import Matrix
from scenes.formats.appearance.spectra import rgb
from scenes.formats.directives.syntax import Parameters
from scenes.formats.geometry.conventions import MAP_AXES, turned_map
from scenes.formats.geometry.transform_stack import TransformStack
from scenes.formats.losses import LossReport


def lamp(kind: str, parameters: Parameters, start: Rgb, strength: Rgb, report: LossReport) -> PointLight:
    """A point light; other kinds become isotropic point lights, which is reported."""
    if kind != "point":
        parameters.asked.update(parameters.given)
        report.add(str(parameters.place), f"light {kind!r}", "a point light of equal intensity in all directions")
    return PointLight(start, strength)


def beside_origin(parameters: Parameters, transforms: TransformStack) -> Rgb:
    """The place of a point light of PBRT v3 and LuxRender: the origin of its space, plus ``from`` along the axes of the
    world (``CreatePointLight`` of PBRT v3; measured with LuxCore)."""
    origin, offset = transforms.current[0][:3, 3], parameters.numbers("from", 3)
    return rgb(origin if offset is None else origin + offset)


def spot(
    parameters: Parameters, start: Rgb, target: Rgb, strength: Rgb, profile: Literal["quartic", "secant"]
) -> SpotLight:
    """A spot light that falls off over the outer part of its cone."""
    outer = parameters.number("coneangle", 30.0)
    inner = outer - parameters.number("conedeltaangle", 5.0)
    return SpotLight(start, target, strength, max(inner, 0.0), outer, profile)


def distant(start: Rgb, target: Rgb, strength: Rgb, where: str, angle_deg: float = 0.0) -> DirectionalLight:
    """A light from one direction.

    Raises:
        SceneError: the two points are the same.
    """
    direction = np.subtract(target, start)
    if not norm(direction) > 0.0:
        raise SceneError(f"{where}: distant: expected from and to apart")
    return DirectionalLight(rgb(direction / norm(direction)), strength, angle_deg)


def even_environment(strength: Rgb) -> EnvironmentLight:
    """An environment of equal radiance in all directions."""
    return EnvironmentLight(np.array([[list(strength)]], np.float32))


def environment_map(image: NDArray[np.float32], placed: Matrix, strength: Rgb, path: Path) -> EnvironmentLight:
    """An environment map, rotated by ``placed``, with its radiance multiplied by ``strength``."""
    turn = turned_map(placed)
    if strength[0] == strength[1] == strength[2]:
        return EnvironmentLight(image, product(turn, MAP_AXES), strength[0], str(path))
    return EnvironmentLight((image * np.array(strength)).astype(np.float32), product(turn, MAP_AXES), 1.0, str(path))


def lose_hints(parameters: Parameters, report: LossReport) -> None:
    """Reports the parameters that control the sampling of a light and not its emission."""
    for hint in ("samples", "nsamples", "importance"):
        if hint in parameters:
            parameters.number(hint, 1.0)
            report.hint(str(parameters.place), f"{hint} of a light", "the renderer's own choice")
