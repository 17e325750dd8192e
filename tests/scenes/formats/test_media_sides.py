"""Media on the sides of mirrored shapes, and volumes of LuxRender that cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import Instance, Medium, Mesh, PerspectiveCamera, Scene, SceneError, Sphere
from scenes.formats.appearance.mixtures import NOTHING
from scenes.formats.conversion import load_scene_file, save_scene_file

FOG, ENDINGS = Medium((0.5, 0.25, 0.1)), {"luxrender": ".lxs", "pbrt": ".pbrt"}


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (-1.0, 1.0, 1.0)])
@pytest.mark.parametrize("target", ["luxrender", "pbrt"])
def test_media_of_mirrored_spheres_stay_inside(target: str, scale: tuple[float, ...], tmp_path: Path) -> None:
    """LuxRender's are meshes, which are recognised as mirrored spheres."""
    ball = Instance(Sphere(), NOTHING, np.diag([*scale, 1.0]), interior=FOG)
    found = Scene(PerspectiveCamera(np.eye(4), 60.0), (ball,))
    for name in ("luxrender", target):
        file = tmp_path / name / f"a{ENDINGS[name]}"
        save_scene_file(found, file, name)
        found = load_scene_file(file)
    assert isinstance(found.instances[0].shape, Sphere) and found.instances[0].interior == FOG


@pytest.mark.parametrize(("inner", "outer"), [(1, 1), (-1, 1), (1, -1), (-1, -1)])
def test_mirrored_objects_of_luxrender_are_turned_once(inner: int, outer: int, tmp_path: Path) -> None:
    """Media are outside where the placed faces are counter-clockwise, whichever of both transforms mirrors them."""
    (tmp_path / "a.lxs").write_text(f"""
    MakeNamedVolume "fog" "clear" "color absorption" [ 1 2 3 ]
    WorldBegin
    ObjectBegin "o"
      Scale {inner} 1 1
      Interior "fog"
      Shape "trianglemesh" "integer indices" [ 0 1 2 ] "point P" [ 0 0 0 1 0 0 0 1 0 ]
    ObjectEnd
    Scale {outer} 1 1
    ObjectInstance "o"
    """)
    (one,) = load_scene_file(tmp_path / "a.lxs").instances
    assert isinstance(one.shape, Mesh)
    a, b, c = one.shape.vertices[one.shape.faces[0]].astype(np.float64)
    outwards = np.linalg.inv(one.to_world[:3, :3]).T @ np.cross(b - a, c - a)  # as a normal is placed
    assert np.sign(outwards[2]) == inner * outer


def test_volumes_of_an_impossible_index_are_one_line(tmp_path: Path) -> None:
    volume = 'MakeNamedVolume "v" "clear" "float fresnel" 0\nWorldBegin\nInterior "v"\nExterior "v"\n'
    (tmp_path / "a.lxs").write_text(f'{volume}Material "glass2"\nShape "sphere"')
    with pytest.raises(SceneError, match="a.lxs:1:1: fresnel: expected a positive index, got 0"):
        load_scene_file(tmp_path / "a.lxs")
