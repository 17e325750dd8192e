"""Declaration of the LuxRender format."""

from scenes.formats.luxrender.read import load_luxrender
from scenes.formats.luxrender.write import save_luxrender
from scenes.formats.text.format import Format

LUXRENDER = Format("LuxRender 1.x", (".lxs",), load_luxrender, save_luxrender)
