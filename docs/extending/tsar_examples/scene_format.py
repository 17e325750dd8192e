"""A format of scene files: a ball a line, as ``x y z radius``."""

import numpy as np

from scenes.animation import camera_to_world
from scenes.canonical import Instance, PerspectiveCamera, Scene, SceneError, Sphere
from scenes.formats.text.format import Format
from tsar_examples.light import window
from tsar_examples.material import striped


def read(path, root, losses) -> Scene:
    balls = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        try:
            x, y, z, radius = map(float, line.split())
        except ValueError:
            raise SceneError(f"{path}:{number}: expected x y z radius, got {line!r}") from None
        place = np.diag([radius, radius, radius, 1.0])
        place[:3, 3] = x, y, z
        balls.append(Instance(Sphere(1.0), striped((0.2, 0.4, 0.8), (0.9, 0.9, 0.9)), place))
    camera = PerspectiveCamera(camera_to_world(np.array([0.0, -8.0, 2.0]), np.zeros(3)), 45.0)
    lights = window((-3.0, -4.0, 4.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 60.0)
    return Scene(camera, tuple(balls), lights, name=path.stem)


BALLS = Format("balls", (".balls",), read)
