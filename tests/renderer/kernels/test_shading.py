"""Phong reflection, shadows and mirrors against closed forms."""

import numpy as np
import pytest

from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    DirectionalLight,
    Disk,
    Emissive,
    EnvironmentLight,
    Instance,
    Integrator,
    Matte,
    Mirror,
    PerspectiveCamera,
    Phong,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
)
from tests.oracles.brute_force_tracer import camera_rays, closest_hits
from tests.renderer.builders import WHITE, batch, center_color, colors, grid, look_at, place, sphere_mesh


def _floor_scene(material, lights, eye=(1.0, 2.0, 0.5), ambient=(0.0, 0.0, 0.0), **rest) -> Scene:
    floor = Instance(Rectangle(), material, place(axis_angle=(-np.pi / 2, 0, 0), scale=(10, 10, 10)))
    return Scene(PerspectiveCamera(look_at(eye, (0, 0, 0))), (floor,), lights, ambient=ambient, **rest)


def _phong(material: Phong, view, towards, irradiance, ambient, mirrored) -> np.ndarray:
    """The formula of canonical.Phong on the plane y = 0."""
    normal = np.array([0.0, 1.0, 0.0])
    view, towards = view / np.linalg.norm(view), towards / np.linalg.norm(towards)
    cosine = normal @ view
    f = material.fresnel_min + (material.fresnel_max - material.fresnel_min) * (1 - cosine) ** material.fresnel_exponent
    diffuse = np.array(material.diffuse.value) * (1 - f)
    reflected = 2 * (normal @ towards) * normal - towards
    lobe = max(reflected @ view, 0.0) ** material.exponent * (material.exponent + 2) / (2 * np.pi)
    lit = (diffuse / np.pi * (normal @ towards) + np.array(material.specular) * lobe) * irradiance
    return material.ambient * diffuse * ambient + lit + f * np.array(material.mirror_tint) * mirrored


@pytest.mark.parametrize("exponent", [1.0, 8.0, 200.0])
def test_phong_value_under_a_directional_light(exponent: float) -> None:
    material = Phong(
        ConstantTexture((0.2, 0.5, 0.7)), (0.4, 0.3, 0.2), exponent, 0.6, 0.05, 0.8, 3.0, mirror_tint=(1.0, 0.8, 0.6)
    )
    sky = EnvironmentLight(np.full((1, 1, 3), 0.7, np.float32), scale=2.0)
    eye, towards = np.array([1.0, 2.0, 0.5]), np.array([-1.2, 2.0, -0.4])
    light = DirectionalLight(tuple(-3 * towards), (3.0, 2.0, 1.0))
    scene = _floor_scene(material, (light, sky), tuple(eye), ambient=(0.1, 0.2, 0.3))
    expected = _phong(material, eye, towards, np.array([3.0, 2.0, 1.0]), np.array([0.1, 0.2, 0.3]), np.full(3, 1.4))
    np.testing.assert_allclose(center_color(scene), expected, rtol=2e-4)


def test_point_light_falls_off_with_the_square_of_distance() -> None:
    material = Phong(ConstantTexture((0.5, 0.5, 0.5)), (0.2, 0.2, 0.2), 10.0)
    at = np.array([0.5, 1.5, -0.3])
    scene = _floor_scene(material, (PointLight(tuple(at), (4.0, 5.0, 6.0)),))
    expected = _phong(material, np.array([1.0, 2.0, 0.5]), at, np.array([4.0, 5.0, 6.0]) / (at @ at), np.zeros(3), 0.0)
    np.testing.assert_allclose(center_color(scene), expected, rtol=2e-4)


def test_matte_reflects_albedo_over_pi_and_emissive_glows_on_both_sides() -> None:
    light = DirectionalLight((0, -1, 0), (np.pi, np.pi, np.pi))
    matte = _floor_scene(Matte(ConstantTexture((0.2, 0.4, 0.6))), (light,), ambient=(9.0, 9.0, 9.0))
    np.testing.assert_allclose(center_color(matte), (0.2, 0.4, 0.6), rtol=1e-5)
    for eye in ((0.1, 2.0, 0.5), (0.1, -2.0, 0.5)):
        np.testing.assert_allclose(center_color(_floor_scene(Emissive((1, 2, 3)), (light,), eye)), (1, 2, 3))


def test_light_behind_the_surface_adds_nothing() -> None:
    scene = _floor_scene(Phong(WHITE, (1.0, 1.0, 1.0), 1.0), (DirectionalLight((0.1, 1.0, 0), (5, 5, 5)),))
    assert (center_color(scene) == 0).all()


def test_no_light_leaks_over_a_smooth_normal() -> None:
    # a coarse sphere: true faces turned away from the sun must stay dark although smooth normals still see it
    mesh = sphere_mesh(4)
    light = DirectionalLight((-1, 0, 0), (1, 1, 1))
    scene = Scene(
        PerspectiveCamera(look_at((0, 0, 4), (0, 0, 0), up=(0, 1, 0)), 40.0),
        (Instance(mesh, Phong(WHITE, (1.0, 1.0, 1.0), 2.0)),),
        (light,),
    )
    position = grid(64)
    origin, direction = camera_rays(scene, position, 0.0)
    got = colors(scene, position).sum(1)
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    hits = closest_hits(scene, origin, direction, 0.0)
    away = (hits.face >= 0) & (normals[hits.face][:, 0] < -1e-6)
    lit = (hits.face >= 0) & (normals[hits.face][:, 0] > 1e-6)
    assert away.sum() > 50 and (got[away] == 0).all()
    assert (got[lit] > 0).mean() > 0.95


@pytest.mark.parametrize("kind", ["directional", "point"])
def test_shadow_of_a_disk_is_where_geometry_says(kind: str) -> None:
    blocker = Instance(Disk(0.4), Matte(WHITE), place((0.2, 1.0, 0.1), (-np.pi / 2, 0, 0)))
    floor = Instance(Rectangle(), Matte(WHITE), place(axis_angle=(-np.pi / 2, 0, 0), scale=(10, 10, 10)))
    light = (
        DirectionalLight((-0.5, -1.0, 0.2), (1, 1, 1))
        if kind == "directional"
        else PointLight((0.4, 2.0, 0), (1, 1, 1))
    )
    scene = Scene(PerspectiveCamera(look_at((0.5, 0.8, 4.0), (0.2, 0, 0)), 50.0), (floor, blocker), (light,))
    position = grid(64)
    origin, direction = camera_rays(scene, position, 0.0)
    t = -origin[:, 1] / direction[:, 1]
    point = origin + t[:, None] * direction
    disk_t = (1.0 - origin[:, 1]) / direction[:, 1]
    through = origin + disk_t[:, None] * direction - np.array([0.2, 1.0, 0.1])
    sees_floor = (t > 0) & (np.abs(point).max(1) < 9) & ~((disk_t > 0) & (np.linalg.norm(through, axis=1) < 0.42))
    towards = (
        np.broadcast_to([0.5, 1.0, -0.2], point.shape) if kind == "directional" else np.array([0.4, 2.0, 0.0]) - point
    )
    crossing = point + (1.0 - point[:, 1:2]) / towards[:, 1:2] * towards - np.array([0.2, 1.0, 0.1])
    radius = np.linalg.norm(crossing, axis=1)
    got = colors(scene, position)[:, 0]
    dark, bright = sees_floor & (radius < 0.399), sees_floor & (radius > 0.401)
    assert dark.sum() > 30 and (got[dark] == 0).all()
    assert (got[bright] > 0).all()


def test_an_occluder_beyond_a_point_light_casts_no_shadow() -> None:
    lid = Instance(Rectangle(), Matte(WHITE), place((0, 3, 0), (np.pi / 2, 0, 0), (5, 5, 5)))
    scene = _floor_scene(Matte(WHITE), (PointLight((0.0, 1.0, 0.0), (np.pi, np.pi, np.pi)),), eye=(0.3, 0.9, 0.5))
    with_lid = Scene(scene.camera, (*scene.instances, lid), scene.lights)
    np.testing.assert_allclose(center_color(with_lid), (1, 1, 1), rtol=1e-4)


def _direction_map(height: int = 64) -> np.ndarray:
    """Environment whose colour is its direction, (d + 1) / 2, by the canonical convention."""
    u = (np.arange(2 * height) + 0.5) / (2 * height) * 2 * np.pi
    theta = (np.arange(height) + 0.5) / height * np.pi
    t, p = np.meshgrid(theta, u, indexing="ij")
    d = np.stack([np.sin(p) * np.sin(t), np.cos(t), -np.cos(p) * np.sin(t)], -1)
    return np.ascontiguousarray((d + 1) / 2, np.float32)


def test_environment_shows_directions_by_the_convention_and_turns_with_its_transform() -> None:
    turn = place(axis_angle=(0.4, 1.1, -0.3))
    for matrix in (np.eye(4), turn):
        scene = Scene(
            PerspectiveCamera(look_at((0, 0, 0), (0.3, 0.2, 1.0)), 90.0),
            (),
            (EnvironmentLight(_direction_map(), matrix),),
        )
        position = grid(24)
        _, direction = camera_rays(scene, position, 0.0)
        np.testing.assert_allclose(colors(scene, position) * 2 - 1, direction @ matrix[:3, :3], atol=3e-3)


def test_background_replaces_the_environment_for_rays_that_miss() -> None:
    light, seen = (EnvironmentLight(np.full((1, 1, 3), value, np.float32)) for value in (1.0, 5.0))
    scene = Scene(PerspectiveCamera(), (), (light,), background=seen)
    np.testing.assert_allclose(center_color(scene), (5, 5, 5))
    assert (center_color(Scene(PerspectiveCamera(), ())) == 0).all()


@pytest.mark.parametrize("shape", [Sphere(1.0), sphere_mesh(48)], ids=["analytic", "mesh"])
def test_mirror_ball_shows_the_mirrored_environment(shape) -> None:
    scene = Scene(
        PerspectiveCamera(look_at((0.5, 0.3, 4.0), (0, 0, 0)), 35.0),
        (Instance(shape, Mirror(ConstantTexture((0.5, 1.0, 0.25))), place(axis_angle=(np.pi / 2, 0, 0))),),
        (EnvironmentLight(_direction_map()),),
    )
    position = grid(48)
    origin, direction = camera_rays(scene, position, 0.0)
    b = (origin * direction).sum(1)
    disc = b * b - (origin * origin).sum(1) + 1
    seen = disc > 0.02  # away from the rim, where a mesh is not a sphere
    point = origin + (-b - np.sqrt(np.maximum(disc, 0)))[:, None] * direction
    mirrored = direction - 2 * (direction * point).sum(1, keepdims=True) * point
    expected = (mirrored + 1) / 2 * (0.5, 1.0, 0.25)
    got = colors(scene, position)
    np.testing.assert_allclose(got[seen], expected[seen], atol=4e-3 if isinstance(shape, Sphere) else 2.5e-2)


@pytest.mark.parametrize(("depth", "bounces"), [(0, 0), (1, 1), (5, 5), (-1, 64), (10**9, 64)])
def test_facing_mirrors_stop_at_the_depth(depth: int, bounces: int) -> None:
    mirrors = tuple(Instance(Rectangle(), Mirror(), place((0, 0, z), scale=(9, 9, 9))) for z in (-1.0, 1.0))
    scene = Scene(PerspectiveCamera(), mirrors, integrator=Integrator(depth=depth))
    answer = Renderer(scene).trace(batch(np.array([[0.5, 0.5]])))
    assert answer.counters == {"primary_rays": 1, "shadow_rays": 0, "reflection_rays": bounces}


def test_weak_mirrors_are_cut_off() -> None:
    half = Mirror(ConstantTexture((0.5, 0.5, 0.5)))
    mirrors = tuple(Instance(Rectangle(), half, place((0, 0, z), scale=(9, 9, 9))) for z in (-1.0, 1.0))
    scene = Scene(PerspectiveCamera(), mirrors, integrator=Integrator(depth=-1))
    answer = Renderer(scene, throughput_cutoff=0.1).trace(batch(np.array([[0.5, 0.5]])))
    assert answer.counters["reflection_rays"] == 3  # 0.5, 0.25, 0.125, then 0.0625
