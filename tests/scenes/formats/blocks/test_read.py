"""Block files and job files: what they hold, where things are at a frame, and one line for what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes import catalog
from scenes.animation import pose_at
from scenes.canonical import DirectionalLight, Glass, Mirror, Phong, Rectangle, SceneError, Sphere
from scenes.formats.blocks.jobs import read_job
from scenes.formats.blocks.read import load_blocks
from scenes.formats.blocks.text import parse_blocks

SMALL = """
# a comment, and an empty line

material
  materialname paint   # another
  diffusecolor 0.6 0.85 1.0
  specularcolor 0.3 0.3 0.3
  ambientcolor 0.06 0.085 0.1
  fresnelminimum 0.3
  fresnelmaximum 1.0
  fresnelexponent 2.0
end
group
  groupname flock
  location 100 0 0
  velocity 0 5 0
  scale 2
end
object
  type sphere
  objectname ball
  materialname paint
  radius 3
  location 1 2 3
  velocity 10 0 0
  groupname flock
end
instance
  objectname ball
  location 0 0 9
  scale 1 2 3
end
camera
  location 0 0 50
  locationvelocity 0 0 -1
  lookat 0 0 0
  lookatvelocity 2 0 0
  fov 40
end
settings
  starttime -10
  frametime 0.5
  numframes 20
  framerate 25
  sizex 64
  sizey 48
  ambientlightcolor 0.7 0.9 1.0
  maxdepth 3
  pointset stratifiedmc
  numsamples 8
  timefilter triangle
  scenename small
end
"""


def loaded(folder: Path, text: str = SMALL):
    path = folder / "scene.txt"
    path.write_text(text)
    return load_blocks(path)


def test_settings_and_materials(tmp_path: Path) -> None:
    scene, settings = loaded(tmp_path)
    assert (settings.name, settings.frame_count, settings.point_set) == ("small", 20, "stratified")
    assert (settings.sample_count, settings.time_filter, settings.width_px) == (8, "triangle", 64)
    assert settings.seconds_per_unit == pytest.approx(1.0 / (25 * 0.5))
    assert scene.ambient == (0.7, 0.9, 1.0) and scene.integrator.depth == 3 and scene.duration_s == 20 / 25
    paint = scene.instances[0].material
    assert isinstance(paint, Phong) and paint.diffuse.value == (0.6, 0.85, 1.0)
    assert (paint.fresnel_min, paint.fresnel_max, paint.fresnel_exponent) == (0.3, 1.0, 2.0)
    assert paint.ambient == pytest.approx(0.1)


def test_where_things_are_at_a_frame(tmp_path: Path) -> None:
    """At ``location + velocity * t`` of the file, a group's outside its members'."""
    scene, settings = loaded(tmp_path)
    ball, other = scene.instances
    for frame in (0, 7, 19):
        t = -10.0 + 0.5 * frame
        pose = pose_at(ball.track, settings.frame_start_s(frame)) @ ball.to_world
        np.testing.assert_allclose(pose[:3, 3], [100 + 2 * 1 + 2 * 10 * t, 2 * 2 + 5 * t, 2 * 3], atol=1e-9)
        np.testing.assert_allclose(pose[:3, :3], 2.0 * np.eye(3))
        camera = pose_at(scene.camera.track, settings.frame_start_s(frame))
        eye, target = np.array([0.0, 0.0, 50.0 - t]), np.array([2.0 * t, 0.0, 0.0])
        np.testing.assert_allclose(camera[:3, 3], eye, atol=1e-9)
        aim = (target - eye) / np.linalg.norm(target - eye)
        np.testing.assert_allclose(-camera[:3, 2], aim, atol=1e-9)
    assert other.track is None and isinstance(other.shape, Sphere) and other.shape.radius == 3.0
    np.testing.assert_allclose(np.diag(other.to_world), [1, 2, 3, 1])
    # between keys the camera's turn is a chord of its true path: a hundredth of a pixel here
    between = settings.frame_start_s(3) + 0.375 / 25
    t = -10.0 + 0.5 * (3 + 0.375)
    aim = np.array([2.0 * t, 0.0, -(50.0 - t)])
    error = np.cross(-pose_at(scene.camera.track, between)[:3, 2], aim / np.linalg.norm(aim))
    assert np.linalg.norm(error) < 1e-5


MORE = """
material
  materialname pane
  type glass
  refractionindex 1.4
  spread 3
end
material
  materialname chrome
  type mirror
end
object
  type rectangle
  materialname pane
end
object
  type cube
  materialname chrome
end
light
  type point
  location 1 2 3
  color 4 5 6
end
light
  type directional
  direction 0 -1 0
  angle 2
end
light
  type spot
  location 0 9 0
  target 0 0 0
  outerangle 20
end
light
  type area
  location 0 9 0
  target 0 0 0
  size 4 2
  color 3 3 3
end
"""


def test_lights_and_other_materials(tmp_path: Path) -> None:
    scene, _ = loaded(tmp_path, SMALL + MORE)
    materials = [type(instance.material) for instance in scene.instances]
    assert materials == [Phong, Phong, Glass, Mirror, Phong]
    assert [type(light).__name__ for light in scene.lights] == ["PointLight", "DirectionalLight", "SpotLight"]
    assert isinstance(scene.lights[1], DirectionalLight) and scene.lights[1].angle_deg == 2.0
    lamp = scene.instances[-1]
    assert isinstance(lamp.shape, Rectangle) and lamp.emission == (3.0, 3.0, 3.0)
    np.testing.assert_allclose(lamp.to_world[:3, 2], [0.0, -1.0, 0.0], atol=1e-12)  # it shines down
    np.testing.assert_allclose(np.linalg.norm(lamp.to_world[:3, :2], axis=0), [2.0, 1.0])


@pytest.mark.parametrize(("name", "instances"), [("planescene", 1), ("spheresscene", 32)])
def test_the_scenes_of_the_study(name: str, instances: int) -> None:
    scene, settings = load_blocks(catalog.blur_scene_file(name))
    assert len(scene.instances) == instances
    assert (settings.frame_count, settings.frame_time, settings.width_px, settings.height_px) == (210, 0.12, 768, 768)
    assert scene.background is not None and scene.camera.track is not None
    assert catalog.load(name).duration_s == pytest.approx(7.0)
    assert any(instance.track is not None for instance in scene.instances)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("\nmaterial\n", "\nmatter\n", r"scene.txt:4: expected one of group, light, .*got 'matter'"),
        ("radius 3", "radios 3", r"scene.txt:23: object: expected one of .*got 'radios'"),
        ("radius 3", "radius", r"object.radius: expected 1 numbers, got none"),
        ("radius 3", "radius three", r"object.radius: expected a number, got 'three'"),
        ("radius 3", "radius inf", r"object.radius: expected a finite number, got 'inf'"),
        ("radius 3", "radius 3\n  radius 4", r"radius occurs twice"),
        ("location 1 2 3", "location 1 2", r"scene.txt:24: object.location: expected 3 numbers, got 1 2"),
        ("materialname paint\n  radius", "materialname pain\n  radius", r"materialname: expected paint, got 'pain'"),
        ("type sphere", "type spear", r"object.type: expected one of model, sphere, .*got 'spear'"),
        ("groupname flock\nend", "groupname herd\nend", r"groupname: expected flock, got 'herd'"),
        ("pointset stratifiedmc", "pointset grid", r"settings.pointset: expected one of hammersley, .*got 'grid'"),
        ("timefilter triangle", "timefilter sinc", r"settings.timefilter: expected one of box, triangle, got 'sinc'"),
        ("numframes 20", "numframes 2.5", r"settings.numframes: expected a whole number"),
        ("frametime 0.5", "frametime 0", r"settings.frametime: expected a positive number"),
        ("scale 1 2 3", "scale 1 0 3", r"instance.scale: expected a transform that can be inverted"),
        ("lookat 0 0 0", "lookat 0 1 50", r"camera: expected a direction of view that is not along up"),
        ("scenename small\nend", "scenename small", r"expected 'end' of the last block, found the end of the file"),
        ("fov 40\nend", "fov 40\nend\nend", r"scene.txt:40: expected one of group, .*got 'end'"),
        ("fresnelminimum 0.3", "fresnelminimum 1.3", r"scene.txt:4: Phong: expected 0 <= fresnel_min"),
    ],
)
def test_faults_are_named_with_file_and_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert SMALL.count(old) >= 1
    with pytest.raises(SceneError, match=message) as caught:
        loaded(tmp_path, SMALL.replace(old, new, 1))
    assert "\n" not in str(caught.value)


def test_missing_blocks_and_files(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="expected exactly one settings block, got 0"):
        loaded(tmp_path, "camera\nlocation 0 0 1\nend\n")
    with pytest.raises(SceneError, match="exactly one camera block, got 2"):
        loaded(tmp_path, SMALL + "camera\nlocation 0 0 1\nlookat 0 0 0\nend\n")
    with pytest.raises(SceneError, match=r"gone.txt: cannot be read"):
        load_blocks(tmp_path / "gone.txt")
    with pytest.raises(SceneError, match=r"expected a file, found none"):
        loaded(tmp_path, SMALL + "object\ntype model\nmodelfilename gone.obj\nend\n")


def test_the_text_keeps_what_it_is_given() -> None:
    block = parse_blocks('object\n\n  type model # yes\n  modelfilename "a b.obj"\n  scale 13\nend', "x")[0]
    assert block.values == {"type": "model", "modelfilename": "a b.obj", "scale": 13.0} and block.where == "x:1"
    assert parse_blocks("", "x") == [] and parse_blocks("# nothing\n\n", "x") == []


JOB = "Plane_scene\n\n8\n1 8 27 64 125 216 343 512\n3\nhammersley stratifiedmc poisson\n2\nbox triangle\n"


def test_a_job_expands_to_all_combinations(tmp_path: Path) -> None:
    path = tmp_path / "job.txt"
    path.write_text(JOB)
    job = read_job(path)
    names = [combination.name for combination in job.combinations]
    assert len(names) == len(set(names)) == 8 * 3 * 2
    assert names[0] == "hammersley-box-0001" and names[-1] == "poisson-triangle-0512"
    assert (job.name, job.point_sets) == ("Plane_scene", ("hammersley", "stratified", "poisson"))
    for built_in in ("plane/plane_job.txt", "spheres/spheres_job.txt"):
        assert len(read_job(catalog.asset(built_in)).combinations) == 48


def test_point_sets_may_be_shifted_by_blue_noise(tmp_path: Path) -> None:
    path = tmp_path / "job.txt"
    path.write_text("Plane\n1\n8\n2\nowen owen+blue\n1\nbox\n")
    plain, blue = read_job(path).combinations
    assert (plain.points, plain.shift, blue.points, blue.shift) == ("owen", "white", "owen", "blue")
    assert blue.name == "owen+blue-box-0008"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("poisson", "poisson+red", r"job.txt:6: point set: expected one of .*got 'poisson\+red'"),
        ("8\n1 8", "7\n1 8", r"job.txt:4: the sampling levels: expected 7, got 8"),
        ("27", "26", r"job.txt:4: sampling level: expected cubes for stratifiedmc, got 26"),
        ("poisson", "poison", r"job.txt:6: point set: expected one of .*got 'poison'"),
        ("triangle", "tent", r"job.txt:8: time filter: expected one of box, triangle, got 'tent'"),
        ("box triangle\n", "", r"expected seven lines .*got 6"),
        ("512", "-1", r"sampling level: expected a whole number of at least 1, got '-1'"),
        ("box triangle", "box box", r"expected each once"),
    ],
)
def test_faults_of_jobs(old: str, new: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "job.txt"
    path.write_text(JOB.replace(old, new, 1))
    with pytest.raises(SceneError, match=message):
        read_job(path)
