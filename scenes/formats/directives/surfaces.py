"""Materials of directive files, converted to the canonical scene.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3), section on materials.
"""

from __future__ import annotations

from collections.abc import Callable

from scenes.canonical import Bumped, ConstantTexture, Material, Matte
from scenes.formats.appearance.spectra import grey
from scenes.formats.directives.syntax import Parameters
from scenes.formats.directives.textures import TextureReader

Maker = Callable[[Parameters], Material]


class SurfaceFactory(TextureReader):
    """Creates textures and materials from parameters; a dialect adds its kinds of materials."""

    def makers(self) -> dict[str, Maker]:
        """Functions that create the materials of each kind."""
        raise NotImplementedError

    def base_colors(self) -> dict[str, str]:
        """Kinds of materials that become matte, with the parameters of their base colours."""
        raise NotImplementedError

    def material(self, kind: str, parameters: Parameters) -> Material:
        """The material of a kind, with its bump map, if there is one; unknown kinds are reported."""
        made = self._plain(kind, parameters)
        if parameters.types.get("bumpmap") == "texture":
            return Bumped(made, self.texture(parameters, "bumpmap", grey(0.0), "float"))
        return made

    def _plain(self, kind: str, parameters: Parameters) -> Material:
        where, makers, base_colors = str(parameters.place), self.makers(), self.base_colors()
        parameters.text("type", kind)
        if kind in makers:
            return makers[kind](parameters)
        if kind in base_colors:
            base = self.texture(parameters, base_colors[kind], grey(0.5))
            parameters.asked.update(parameters.given)
            self.report.add(where, f"material {kind!r}", "matte of its base colour")
            return Matte(base)
        parameters.asked.update(parameters.given)
        self.report.unknown(where, "material", kind, "grey, matte")
        return Matte(ConstantTexture(grey(0.5)))

    def matte(self, parameters: Parameters) -> Material:
        """A matte surface."""
        return Matte(self.texture(parameters, "Kd", grey(0.5)), self.scalar(parameters, "sigma", 0.0))

    def mixed(self, parameters: Parameters) -> list[Material]:
        """The two materials of a mixture."""
        names = ("namedmaterial1", "namedmaterial2")
        return [self.named(parameters.text(name, ""), str(parameters.place)) for name in names]

    def named(self, name: str, where: str) -> Material:
        """The material of a name; an undefined one is grey, which is reported."""
        if name not in self.names.materials:
            self.report.add(where, f"material {name!r}, which is not defined", "grey, matte")
            return Matte(ConstantTexture(grey(0.5)))
        return self.names.materials[name]
