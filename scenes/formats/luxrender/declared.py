"""Declaration of the LuxRender format."""

from scenes.formats.luxrender.read import load_luxrender
from scenes.formats.luxrender.write import save_luxrender
from scenes.formats.luxrender.write_parts import save_luxrender_parts
from scenes.formats.text.format import Format

LUXRENDER = Format("LuxRender 1.x", (".lxs",), load_luxrender, save_luxrender)
LUXRENDER_PARTS = Format("LuxRender 1.x in three files", (), load_luxrender, save_luxrender_parts)
