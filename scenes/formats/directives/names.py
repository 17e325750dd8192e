"""Names of textures and materials, whose scope is the block that defines them.

Source: PBRT v3, ``GraphicsState``: a block works on a copy of the tables, and float and colour textures have separate
tables. LuxRender 1.x has the same.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from scenes.canonical import Material, Rgb, Texture

Of = Literal["color", "float"]
"""Type of a texture's values."""


@dataclass
class Names:
    """Tables of named objects. Names defined in a block are removed at its end, at a cost proportional to their number.

    Attributes:
        lasting: whether names are never removed, as in PBRT v4, where they belong to the whole scene.
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
        """Defines a name within the innermost block."""
        self._before.append((table, name, table.get(name)))
        table[name] = value

    def mark(self) -> int:
        """Marks the beginning of a block."""
        return len(self._before)

    def forget(self, mark: int) -> None:
        """Ends the block that began at a mark."""
        while len(self._before) > mark and not self.lasting:
            table, name, value = self._before.pop()
            if value is None:
                del table[name]
            else:
                table[name] = value
