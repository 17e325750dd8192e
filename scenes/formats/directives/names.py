"""Names of textures and materials, which hold within the block that they are given in.

Source: PBRT v3, ``GraphicsState``: a block works on a copy of the tables, and textures of numbers and of colours have
tables of their own. LuxRender 1.x has the same.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from scenes.canonical import Material, Rgb, Texture

Of = Literal["color", "float"]
"""What the values of a texture are."""


@dataclass
class Names:
    """Tables of what has a name; what a block names is forgotten at its end, which costs no more than it named.

    Attributes:
        lasting: whether nothing is forgotten: names of PBRT v4 belong to the whole scene.
    """

    colors: dict[str, Texture] = field(default_factory=dict)
    floats: dict[str, Texture] = field(default_factory=dict)
    materials: dict[str, Material] = field(default_factory=dict)
    indices: dict[str, tuple[Rgb, Rgb]] = field(default_factory=dict)
    lasting: bool = False
    _before: list[tuple[dict[str, Any], str, Any]] = field(default_factory=list)

    def textures(self, of: Of) -> dict[str, Texture]:
        """The textures of a type."""
        return self.colors if of == "color" else self.floats

    def define(self, table: dict[str, Any], name: str, value: Any) -> None:
        """Gives a name within the innermost block."""
        self._before.append((table, name, table.get(name)))
        table[name] = value

    def mark(self) -> int:
        """Where a block begins."""
        return len(self._before)

    def forget(self, mark: int) -> None:
        """Ends the block that began at a mark."""
        while len(self._before) > mark and not self.lasting:
            table, name, value = self._before.pop()
            if value is None:
                del table[name]
            else:
                table[name] = value
