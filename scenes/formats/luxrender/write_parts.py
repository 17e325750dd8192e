"""Writer of LuxRender 1.x scenes in three files, as exporters write them: the main file (``.lxs``) has camera, settings
and lights, and includes the materials and textures (``.lxm``) and the shapes (``.lxo``).

Source: LuxRender scene file format 1.0 (wiki of LuxRender), directive ``Include``.
"""

from __future__ import annotations

from scenes.canonical import Instance, Scene
from scenes.formats.directives.scene_writer import quoted
from scenes.formats.losses import LossReport
from scenes.formats.luxrender.write import LuxWriter
from scenes.formats.text.output import Output


class LuxPartsWriter(LuxWriter):
    """Collects the lines of the three files.

    Attributes:
        shapes: lines of the shapes.
    """

    def __init__(self, output: Output, report: LossReport) -> None:
        super().__init__(output, report)
        self.definitions: list[str] = []
        self.shapes: list[str] = []

    def write_instance(self, instance: Instance) -> None:
        main, self.lines = self.lines, self.shapes
        try:
            super().write_instance(instance)
        finally:
            self.lines = main


def save_luxrender_parts(scene: Scene, output: Output, report: LossReport) -> None:
    """Writes a scene and its files; they are not in place before the output is placed."""
    writer = LuxPartsWriter(output, report)
    writer.write(scene)
    included = []
    for ending, lines in ((".lxm", writer.definitions), (".lxo", writer.shapes)):
        name = f"{output.path.stem}{ending}".replace('"', "").replace("\\", "-")  # what a quoted name can hold
        included.append(f"\tInclude {quoted(name)}")
        output.text(name, "\n".join(lines) + "\n")
    at = writer.lines.index("WorldBegin") + 1
    output.text(output.path.name, "\n".join([*writer.lines[:at], *included, *writer.lines[at:]]) + "\n")
