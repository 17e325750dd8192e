"""One minimal scene for each effect of the ray tracer.

World space has ``z`` up and a floor at ``z = 0``; the camera looks along ``+y``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from PIL import Image

from scenes.animation import camera_to_world
from scenes.arithmetic import norm
from scenes.canonical import (
    ConstantTexture,
    Cube,
    DirectionalLight,
    EnvironmentCamera,
    Glass,
    HeightField,
    ImageTexture,
    Instance,
    Integrator,
    Mirror,
    OrthographicCamera,
    PerspectiveCamera,
    Phong,
    PointLight,
    Rectangle,
    RigidTrack,
    Scene,
    SceneError,
    Sphere,
    SpotLight,
)
from scenes.driving import sky
from scenes.effects.stage import (
    AMBIENT,
    BLUE,
    EYE,
    GREY,
    RED,
    SUN,
    TARGET,
    floor,
    haze,
    lamp,
    paint,
    pair,
    placed,
    staged,
)
from scenes.loading import asset, read_image

SHUTTER_S = 0.5
"""Time for which the shutter of the blurred scenes is open, from time 0, seconds."""

_SPEED = 3.0  # speed of moving objects, scene units per second


@dataclass(frozen=True)
class Effect:
    """An effect.

    Attributes:
        what: description for captions.
        scene: creates the scene that shows the effect.
    """

    what: str
    scene: Callable[[], Scene]


def plain() -> Scene:
    """Hard shadows of a point light; a chequered floor up to the horizon, for anti-aliasing."""
    balls = pair(paint(RED, specular=(0.3, 0.3, 0.3), exponent=60.0), paint(BLUE))
    lamp = PointLight((-3.0, -4.0, 6.0), (110.0, 105.0, 95.0))
    return Scene(
        PerspectiveCamera(camera_to_world(np.array(EYE), np.array(TARGET)), 38.0),
        (floor(8.0), *balls),
        (lamp,),
        ambient=AMBIENT,
        background=haze(),
    )


def quad_light() -> Scene:
    """A square lamp: shadows soften with the distance from the object that casts them."""
    return staged(*pair(paint(RED), paint(BLUE)), lamp((-2.5, -1.0, 5.5), 1.2, 16.0))


def quad_light_cells() -> Scene:
    """Like :func:`quad_light`, with a shadow ray to each of 16 cells."""
    scene = quad_light()
    return Scene(
        scene.camera,
        scene.instances,
        scene.lights,
        integrator=Integrator(shadow_rays="all", light_cells=4),
        ambient=scene.ambient,
        background=scene.background,
    )


def sphere_light() -> Scene:
    """A glowing ball between two others."""
    glow = Instance(Sphere(0.45), paint(GREY), placed((0.0, -1.6, 0.45)), name="lamp", emission=(14.0, 12.0, 8.0))
    return staged(*pair(paint(RED), paint(BLUE)), glow)


def spot_light() -> Scene:
    """A spot light with a soft edge."""
    spot = SpotLight((-3.0, -5.0, 7.0), (0.0, 0.0, 0.6), (260.0, 245.0, 210.0), 9.0, 15.0)
    return staged(*pair(paint(RED), paint(BLUE)), lights=(spot,))


def sun_disc() -> Scene:
    """A sun of ten times its width: the penumbra widens along a shadow."""
    sun = DirectionalLight((0.8, 0.7, -0.6), (3.0, 2.8, 2.4), angle_deg=5.3)
    return staged(*pair(paint(RED), paint(BLUE)), lights=(sun,))


def environment_light() -> Scene:
    """Light from a whole sky image."""
    light = sky.sky()
    balls = pair(paint((0.8, 0.8, 0.8), ambient=0.0), Mirror())
    floor = Instance(Rectangle(), paint(GREY, ambient=0.0), placed((0, 6, 0), (12, 12, 1)), name="floor")
    camera = PerspectiveCamera(camera_to_world(np.array(EYE), np.array(TARGET)), 38.0)
    return Scene(camera, (floor, *balls), (light,))


def glossy_reflection() -> Scene:
    """The same mirror three times: perfect, and spread by 12 and by 40 degrees."""
    balls = [
        Instance(Sphere(0.95), Mirror(ConstantTexture((0.9, 0.9, 0.9)), spread), placed((x, 0.0, 0.95)), name=f"{x}")
        for x, spread in ((-2.1, 0.0), (0.0, 12.0), (2.1, 40.0))
    ]
    return staged(*balls, lights=(SUN,))


def glass() -> Scene:
    """A solid ball of glass, a bubble with a thin shell, and a box."""
    solid, shell = Glass(), Glass(thin=True)
    box = placed((2.3, 0.6, 0.95), (0.7, 0.7, 0.9))  # slightly above the floor, so that the two do not coincide
    return staged(
        Instance(Sphere(1.0), solid, placed((-0.2, 0.0, 1.0)), name="ball"),
        Instance(Sphere(0.9), shell, placed((-2.4, 0.6, 0.9)), name="bubble"),
        Instance(Cube(), solid, box, name="block"),
        Instance(Cube(), paint(RED), placed((0.6, 3.2, 0.8), (0.8, 0.8, 0.8)), name="behind"),
        lights=(SUN,),
        integrator=Integrator(depth=8),
    )


def glossy_refraction() -> Scene:
    """Panes of frosted glass before the same boxes: clear, spread by 4 and by 14 degrees."""
    panes = [
        Instance(
            Cube(), Glass(thin=True, spread_deg=spread), placed((x, -1.5, 1.2), (0.95, 0.02, 1.2)), name=f"pane {x}"
        )
        for x, spread in ((-2.1, 0.0), (0.0, 4.0), (2.1, 14.0))
    ]
    boxes = [
        Instance(Cube(), paint(color), placed((x, 1.2, 0.6), (0.35, 0.35, 0.6)), name=f"box {x}")
        for x, color in ((-2.6, RED), (-1.6, BLUE), (-0.5, RED), (0.5, BLUE), (1.6, RED), (2.6, BLUE))
    ]
    integrator = Integrator(depth=6, reflection_rays=2, refraction_rays=4)
    return staged(*panes, *boxes, lights=(SUN,), integrator=integrator)


def depth_of_field() -> Scene:
    """A row of balls, the third in focus."""
    balls = [
        Instance(Sphere(0.55), paint(color, specular=(0.3, 0.3, 0.3)), placed((x, y, 0.55)), name=f"{y}")
        for (x, y), color in zip(
            ((-2.0, -4.0), (-1.1, -2.0), (0.0, 0.5), (1.6, 4.0), (4.0, 9.0)),
            (BLUE, RED, (0.8, 0.65, 0.1), RED, BLUE),
            strict=True,
        )
    ]
    distance = norm(np.subtract((0.0, 0.5, 0.55), EYE))
    camera = PerspectiveCamera(
        camera_to_world(np.array(EYE), np.array((0.0, 0.5, 0.55))), 38.0, lens_radius=0.28, focal_distance=distance
    )
    return staged(*balls, lights=(SUN,), camera=camera)


def _sliding(velocity: tuple[float, float, float]) -> RigidTrack:
    """A constant velocity from time 0 on."""
    ends = np.array([(0.0, 0.0, 0.0), velocity]) * SHUTTER_S
    return RigidTrack(0.0, SHUTTER_S, ends, np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)))


def moving_object() -> Scene:
    """A ball that moves to the right past one at rest, with its shadow."""
    camera = PerspectiveCamera(camera_to_world(np.array(EYE), np.array(TARGET)), 38.0, shutter_s=(0.0, SHUTTER_S))
    return staged(
        Instance(Sphere(0.8), paint(RED), placed((-1.8, -1.0, 0.8)), _sliding((_SPEED, 0.0, 0.0)), name="moving"),
        Instance(Sphere(0.8), paint(BLUE), placed((1.8, 1.0, 0.8)), name="still"),
        lights=(SUN,),
        camera=camera,
    )


def moving_camera() -> Scene:
    """The camera moves to the right: near objects blur most."""
    camera = PerspectiveCamera(
        camera_to_world(np.array(EYE), np.array(TARGET)),
        38.0,
        track=_sliding((1.2, 0.0, 0.0)),
        shutter_s=(0.0, SHUTTER_S),
    )
    return staged(*pair(paint(RED), paint(BLUE)), lights=(SUN,), camera=camera)


def height_field() -> Scene:
    """Paving as a height field on a rectangle, with a low sun: stones hide and shade their joints, even at the
    border."""
    height = np.asarray(Image.open(asset("pavement_height_512.png")).convert("L"), np.float32) / 255.0
    stone = Phong(ImageTexture(read_image(asset("pavement_albedo_512.png"))))
    relief = Instance(Rectangle(), HeightField(stone, height, 0.16, 128), placed((0, 0, 1), (2.2, 2.2, 1)), name="slab")
    camera = PerspectiveCamera(camera_to_world(np.array((1.5, -5.5, 2.6)), np.array((0.0, 0.0, 0.9))), 42.0)
    low = DirectionalLight((1.0, 0.35, -0.42), (3.2, 2.9, 2.4))
    return staged(relief, lights=(low,), camera=camera)


def parallel_projection() -> Scene:
    """No perspective: equal boxes are equally large at any distance."""
    boxes = [
        Instance(Cube(), paint(color), placed((x, 3.0 * x, 0.5), (0.5, 0.5, 0.5)), name=f"{x}")
        for x, color in ((-2.0, RED), (0.0, BLUE), (2.0, RED))
    ]
    camera = OrthographicCamera(camera_to_world(np.array((0.0, -9.0, 7.0)), np.array((0.0, 1.0, 0.5))), 4.2)
    return staged(*boxes, lights=(SUN,), camera=camera)


def whole_sphere() -> Scene:
    """The whole sphere around the camera in a latitude–longitude projection."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # +y of the camera is up
    matrix[:3, 3] = (0.0, -3.0, 1.5)
    return staged(*pair(paint(RED), Mirror()), lights=(SUN,), camera=EnvironmentCamera(matrix))


EFFECTS: dict[str, Effect] = {
    scene.__name__.replace("_", "-"): Effect(what, scene)
    for scene, what in (
        (plain, "anti-aliasing, hard shadows of a point light"),
        (quad_light, "soft shadows of a square lamp, one shadow ray a sample"),
        (quad_light_cells, "the same, a shadow ray to each of 16 cells"),
        (sphere_light, "soft shadows of a glowing ball"),
        (spot_light, "spot light"),
        (sun_disc, "sun with an extent"),
        (environment_light, "light from an environment map, importance-sampled"),
        (glossy_reflection, "glossy reflection, spread by 0, 12 and 40 degrees"),
        (glass, "refraction: solid, thin, block"),
        (glossy_refraction, "glossy refraction, spread by 0, 4 and 14 degrees"),
        (depth_of_field, "depth of field of a thin lens"),
        (moving_object, "motion blur of an object"),
        (moving_camera, "motion blur of the camera"),
        (height_field, "height field with self-shadows"),
        (parallel_projection, "parallel projection"),
        (whole_sphere, "view of the whole sphere"),
    )
}
"""Effects by the name of their scene."""


def load(name: str) -> Scene:
    """The scene of an effect.

    Raises:
        SceneError: no effect has this name.
    """
    if name not in EFFECTS:
        raise SceneError(f"effect: expected one of {', '.join(EFFECTS)}, got {name!r}")
    return EFFECTS[name].scene()
