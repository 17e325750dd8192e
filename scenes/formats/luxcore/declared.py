"""Declaration of the LuxCore format."""

from scenes.formats.luxcore.read import load_luxcore
from scenes.formats.text.format import Format

LUXCORE = Format("LuxCore", (".cfg", ".scn"), load_luxcore)
