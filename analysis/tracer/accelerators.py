"""Savings by acceleration structures: tests per ray against triangle count, and the two images of the report."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from functools import partial
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.command.progress import Bars, Task
from analysis.command.timing import take_turns
from analysis.tracer.options import AcceleratorOptions
from scenes.canonical import Mesh
from scenes.effects import report_images as report

if TYPE_CHECKING:
    from torch import Tensor

REPORTED = {
    "report-one": {"triangle_tests": 18.5e9, "one_process_s": 5210.0, "twenty_processes_s": 320.0},
    "report-two": {"triangle_tests": 16.0e9, "one_process_s": 8240.0, "twenty_processes_s": 610.0},
}
"""Figures of the report for its images."""

STRUCTURES = ("brute", "kdtree", "bvh")
_BRUTE_TESTS = 4e8  # triangle tests in a turn, which limit the rays of brute force
_SIDE_PX = 256


def knot_of(triangles: int) -> Mesh:
    """A knotted tube of about ``triangles`` triangles, scaled into ``[-1, 1]³``."""
    around = max(4, round((triangles / 31.0) ** 0.5))
    tube = report.knotted_tube(around, max(4, round(triangles / (2 * around))))
    low, high = tube.vertices.min(axis=0), tube.vertices.max(axis=0)
    return Mesh((tube.vertices - (low + high) / 2) / ((high - low).max() / 2), tube.faces, source="knot")


def camera_rays() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Rays of a square picture that the mesh fills."""
    step = (2.0 * (np.arange(_SIDE_PX) + 0.5) / _SIDE_PX - 1.0) * 0.36
    x, y = np.meshgrid(step, -step)
    direction = np.stack([x, y, np.full_like(x, -1.0)], axis=-1).reshape(-1, 3)
    return np.tile(np.array([0.0, 0.0, 3.2], np.float32), (len(direction), 1)), direction.astype(np.float32)


def random_rays(count: int, seed: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Rays from random points in the mesh's bounding box in random directions."""
    rng = np.random.default_rng(seed)
    direction = rng.standard_normal((count, 3))
    return rng.uniform(-1.0, 1.0, (count, 3)).astype(np.float32), direction.astype(np.float32)


def measure(triangles: int, options: AcceleratorOptions, task: Task) -> list[dict[str, Any]]:
    """Rows of the table for one mesh, one for each structure and kind of rays.

    Raises:
        RuntimeError: structures disagree about a hit.
    """
    from renderer.rays.single_rays import SingleRays

    mesh = knot_of(triangles)
    built, build_s = {}, {}
    for name in STRUCTURES:
        start = time.perf_counter()
        built[name] = SingleRays(mesh.vertices, mesh.faces, name)
        build_s[name] = time.perf_counter() - start
    rows = []
    for kind, (origin, direction) in (("camera", camera_rays()), ("random", random_rays(_SIDE_PX**2, options.seed))):
        some = slice(0, None, max(1, round(len(origin) * len(mesh.faces) / _BRUTE_TESTS)))
        chosen = {name: (some if name == "brute" else slice(None)) for name in STRUCTURES}
        found = {name: built[name].counted(origin[chosen[name]], direction[chosen[name]]) for name in STRUCTURES}
        for name in STRUCTURES[1:]:
            if not np.array_equal(found[name][0].face[some], found["brute"][0].face):
                raise RuntimeError(f"{name} and brute force disagree at {len(mesh.faces)} triangles, {kind} rays")
        parts = {name: (origin[chosen[name]], direction[chosen[name]]) for name in STRUCTURES}
        cases = {name: partial(built[name].closest, *parts[name]) for name in STRUCTURES}
        seconds = take_turns(cases, options.repetitions)
        task.advance()
        for name in STRUCTURES:
            count, work = len(origin[chosen[name]]), found[name][1]
            rows.append(
                {
                    "triangles": len(mesh.faces),
                    "rays": kind,
                    "structure": name,
                    "rays_traced": count,
                    "tests_per_ray": work.triangle_tests / count,
                    "visits_per_ray": work.node_visits / count,
                    "fewer_tests_than_brute": len(mesh.faces) * count / max(work.triangle_tests, 1),
                    "build_s": build_s[name],
                    "mrays_per_s": count / median(seconds[name]) / 1e6,
                }
            )
    return rows


def render_report_image(name: str, options: AcceleratorOptions, bars: Bars) -> tuple[Tensor, dict[str, Any]]:
    """One of the report's images with 32 samples a pixel, and its numbers of rays and tests beside the report's."""
    from renderer.frames import render_image, tile_count
    from renderer.sampling.plan import SamplePlan
    from renderer.trace import Renderer

    scene = report.load(name)
    width, height = (max(1, round(side * options.image_scale)) for side in (scene.film.width_px, scene.film.height_px))
    threads, work = options.threads or None, Counter[str]()
    renderer = Renderer(scene, threads=threads, seed=options.seed, structure=options.structure, count_work=True)
    plan = SamplePlan(report.SAMPLES, "hammersley", options.seed, "gaussian")
    task = bars.task(name, tile_count(width, height))
    start = time.perf_counter()
    image = render_image(renderer, plan, width, height, 0.0, renderer.shutter_s, done=task.reach, counters=work)
    wall_s = time.perf_counter() - start
    renderer.close()
    rays = sum(count for kind, count in work.items() if kind.endswith("_rays"))
    polygons = report.polygon_count(scene)
    return image, {
        "polygons": polygons,
        "size_px": [width, height],
        "samples_per_pixel": report.SAMPLES,
        "structure": options.structure,
        "threads": renderer.threads,
        "wall_s": wall_s,
        **work,
        "rays": rays,
        "tests_per_ray": work["triangle_tests"] / rays,
        "brute_tests": float(rays * polygons),
        "fewer_tests_than_brute_for_primary_rays": work["primary_rays"] * polygons / max(work["triangle_tests"], 1),
        "fewer_tests_than_brute": rays * polygons / max(work["triangle_tests"], 1),
        "report": REPORTED[name],
    }


def lines(found: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines on the cost of rendered images, beside the figures of the report."""
    return [
        f"{name}: {each['size_px'][0]} x {each['size_px'][1]}, {each['polygons']:,} polygons, {each['wall_s']:.1f} s, "
        f"{each['rays'] / 1e6:.1f} M rays, {each['triangle_tests'] / 1e9:.2f} G triangle tests "
        f"({each['tests_per_ray']:.1f} a ray, {each['fewer_tests_than_brute']:.0f} times fewer than brute force, "
        f"{each['fewer_tests_than_brute_for_primary_rays']:.0f} times than brute force for the primary rays alone); "
        f"report: {each['report']['triangle_tests'] / 1e9:.1f} G tests, {each['report']['one_process_s']:.0f} s"
        for name, each in found.items()
    ]
