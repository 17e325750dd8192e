"""Meshes that move together are traced as one, with the same picture."""

import dataclasses

import numpy as np
import pytest

from renderer.tables import merging
from renderer.tables.merging import assemble
from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    Cube,
    DirectionalLight,
    ImageTexture,
    Instance,
    Mesh,
    PerspectiveCamera,
    Phong,
    RigidTrack,
    Scene,
    SceneError,
    Sphere,
)
from tests.renderer.builders import WHITE, look_at, place, sphere_mesh, turning_track, vehicle_scene

BALL = sphere_mesh(12)
FLAT = Mesh(BALL.vertices, BALL.faces)
PLAIN = Mesh(BALL.vertices, BALL.faces, BALL.normals)


def _pair(track: RigidTrack | None = None) -> tuple[Instance, ...]:
    rng = np.random.default_rng(1)
    picture = Phong(ImageTexture(rng.random((16, 16, 3), dtype=np.float32), uv_scale=(3.0, 2.0)), (0.5, 0.5, 0.5), 20.0)
    paint = Phong(ConstantTexture((0.2, 0.6, 0.3)), fresnel_min=0.3, fresnel_max=0.8)
    return (
        Instance(BALL, picture, place((-0.9, 0.2, 0.0), (0.3, 0.2, 0.9), (0.8, 0.5, 1.0)), track, "picture"),
        Instance(PLAIN, paint, place((0.8, 0.0, 0.4), (1.0, 0.0, 0.4), (0.5, -0.9, 0.6)), track, "mirrored"),
        Instance(FLAT, paint, place((0.0, -0.7, 0.9), scale=(0.4, 0.3, 0.4)), track, "faceted"),
    )


def _scene(instances) -> Scene:
    return Scene(
        PerspectiveCamera(look_at((0.5, 1.0, 5.0), (0, 0, 0)), 35.0),
        tuple(instances),
        (DirectionalLight((-1, -2, -1), (2, 2, 2)),),
        ambient=(0.2, 0.2, 0.2),
    )


@pytest.mark.parametrize("track", [None, turning_track(3)], ids=["still", "moving"])
def test_merged_meshes_look_like_separate_ones(monkeypatch, track: RigidTrack | None) -> None:
    scene = _scene(_pair(track))
    assert [len(assembly.parts) for assembly in assemble(scene.instances)[0]] == [3]
    merged = Renderer(scene).render_frame(0.2, 96, 96)
    monkeypatch.setattr(merging, "SIZE_RATIO_MAX", 0.0)
    assert assemble(scene.instances) == ([], list(scene.instances))
    separate = Renderer(scene).render_frame(0.2, 96, 96)
    assert (merged > 0.0).any(-1).float().mean() > 0.1
    assert ((merged - separate).abs().amax(-1) > 1e-3).float().mean() < 0.001


def test_only_meshes_on_the_same_track_merge() -> None:
    track = turning_track(1)
    moving = [dataclasses.replace(part, track=track) for part in _pair()]
    others = [Instance(Sphere(), Phong(WHITE)), Instance(Cube(), Phong(WHITE), track=track)]
    assemblies, rest = assemble([*_pair(), *moving, *others, Instance(BALL, Phong(WHITE), track=turning_track(2))])
    assert [assembly.track for assembly in assemblies] == [None, track]
    assert [assembly.face_counts for assembly in assemblies] == [[len(BALL.faces)] * 3] * 2
    assert len(rest) == 3 and rest[:2] == others


def test_tiny_parts_stay_alone() -> None:
    tiny = Instance(BALL, Phong(WHITE), place(scale=(1e-4,) * 3))
    assemblies, rest = assemble([*_pair(), tiny])
    assert rest == [tiny] and len(assemblies) == 1


def test_a_mesh_shared_too_often_is_not_copied(monkeypatch) -> None:
    monkeypatch.setattr(merging, "COPIED_FACES_MAX", 5 * len(BALL.faces))
    row = [Instance(BALL, Phong(WHITE), place((float(i), 0, 0))) for i in range(7)]
    assert [len(assembly.parts) for assembly in assemble(row[:6])[0]] == [6]
    assert assemble(row) == ([], row)


def test_faults_name_the_part() -> None:
    bad = dataclasses.replace(_pair()[0], material=Phong(ConstantTexture((np.nan, 0, 0))), name="odd")
    with pytest.raises(SceneError, match="'odd'.*finite"):
        Renderer(_scene([*_pair(), bad]))


def test_a_vehicle_is_one_mesh_on_each_track() -> None:
    assemblies, rest = assemble(vehicle_scene().instances)
    assert [len(assembly.parts) for assembly in assemblies] == [12]
    assert len(rest) == 1 + 15 + 4
