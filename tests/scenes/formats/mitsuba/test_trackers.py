"""What reports in public trackers of Mitsuba turned up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.formats.conversion import load_scene_file
from scenes.formats.geometry.transform_stack import rotation
from tests.scenes.formats.files import SENSOR

TURNED = rotation(30.0, 0.0, 1.0, 0.0)
UPRIGHT = np.diag([1.0, 2.0, 3.0, 1.0])


def _scene(folder: Path, body: str, version: str = "3.0.0"):
    path = folder / "a.xml"
    path.write_text(f'<scene version="{version}">{SENSOR}{body}</scene>')
    return load_scene_file(path)


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        ('<rotate value="0, 1, 0" angle="30"/>', TURNED),
        ('<rotate y="1" angle="30"/>', TURNED),
        ('<matrix value="1 0 0  0 2 0  0 0 3"/>', UPRIGHT),
        ('<matrix value="1 0 0 0  0 2 0 0  0 0 3 0  0 0 0 1"/>', UPRIGHT),
        ('<scale value="1, 2, 3"/>', UPRIGHT),
    ],
)
def test_steps_of_a_transform_may_be_one_value(step: str, expected: np.ndarray, tmp_path: Path) -> None:
    scene = _scene(tmp_path, f'<shape type="cube"><transform name="to_world">{step}</transform></shape>')
    assert np.allclose(scene.instances[0].to_world, expected)
