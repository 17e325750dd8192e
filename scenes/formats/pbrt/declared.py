"""PBRT among the formats."""

from scenes.formats.pbrt.read import load_pbrt
from scenes.formats.pbrt.write import save_pbrt
from scenes.formats.text.format import Format

PBRT = Format("PBRT v3", (".pbrt",), load_pbrt, save_pbrt)
