"""Mitsuba among the formats."""

from scenes.formats.mitsuba.read import load_mitsuba
from scenes.formats.mitsuba.write import save_mitsuba, save_mitsuba3
from scenes.formats.text.format import Format

MITSUBA = Format("Mitsuba 0.5", (".xml",), load_mitsuba, save_mitsuba)
MITSUBA_3 = Format("Mitsuba 3", (), None, save_mitsuba3)
