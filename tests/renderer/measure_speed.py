"""Measures shaded samples per second: ``python -m tests.renderer.measure_speed``.

The scene: a textured ground, an object of 20,000 triangles in ten moving parts that mirrors its surroundings, a sky and
a sun. Every primary hit takes a shadow ray; the object's also take a mirrored ray.
"""

from __future__ import annotations

import time

import numpy as np

from renderer.device import core_count
from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    DirectionalLight,
    EnvironmentLight,
    ImageTexture,
    Instance,
    PerspectiveCamera,
    Phong,
    Rectangle,
    RigidTrack,
    Scene,
)
from tests.renderer.builders import batch, look_at, place, sphere_mesh

SIDE_PX = 512


def measured_scene(parts: int = 10) -> Scene:
    """The scene described above."""
    rng = np.random.default_rng(0)
    ground = Phong(ImageTexture(rng.random((512, 512, 3), dtype=np.float32), uv_scale=(20, 20)))
    paint = Phong(ConstantTexture((0.6, 0.1, 0.1)), (0.3, 0.3, 0.3), 50.0, fresnel_min=0.1, fresnel_max=1.0)
    mesh = sphere_mesh(23)  # 2024 triangles
    tracks = [
        RigidTrack(
            0.0,
            1.0,
            np.array([[0, 0, 0], [0.1 * i, 0, 0]]),
            np.array([[0, 0, 0, 1.0], [0, np.sin(0.2), 0, np.cos(0.2)]]),
        )
        for i in range(5)
    ]
    ring = [
        Instance(mesh, paint, place((1.4 * np.cos(a), 0.7, 1.4 * np.sin(a)), scale=(0.7,) * 3), tracks[i % 5])
        for i, a in enumerate(np.linspace(0, 2 * np.pi, parts, endpoint=False))
    ]
    floor = Instance(Rectangle(), ground, place(axis_angle=(-np.pi / 2, 0, 0), scale=(50, 50, 50)))
    return Scene(
        PerspectiveCamera(look_at((0, 1.6, 6), (0, 0.7, 0)), 45.0),
        (floor, *ring),
        (DirectionalLight((-1, -2, -1), (2, 2, 2)), EnvironmentLight(rng.random((256, 512, 3), dtype=np.float32))),
        ambient=(0.3, 0.3, 0.3),
    )


def _best_s(action, repeats: int = 5) -> float:
    taken = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        taken.append(time.perf_counter() - start)
    return min(taken)


def main() -> None:
    """Prints million samples and rays per second for one thread and for all."""
    scene = measured_scene()
    step = (np.arange(SIDE_PX) + 0.5) / SIDE_PX
    blocks = np.stack(np.meshgrid(step, step), -1).reshape(SIDE_PX // 4, 4, SIDE_PX // 4, 4, 2).transpose(0, 2, 1, 3, 4)
    position = blocks.reshape(-1, 2)
    for threads in sorted({1, core_count()}):
        renderer = Renderer(scene, threads=threads)
        for name, times in (("one time", 0.5), ("own times", np.linspace(0, 1, len(position)))):
            request = batch(position, times, 16)
            rays = sum(renderer.trace(request).counters.values())
            taken = _best_s(lambda renderer=renderer, request=request: renderer.trace(request))
            samples = len(position) / taken / 1e6
            print(f"{threads} threads, {name}: {samples:.2f} M samples/s, {rays / taken / 1e6:.2f} M rays/s")


if __name__ == "__main__":
    main()
