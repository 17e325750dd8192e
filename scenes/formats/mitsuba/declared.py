"""Declaration of the Mitsuba formats."""

from scenes.formats.mitsuba.dictionaries import load_dictionary
from scenes.formats.mitsuba.read import load_mitsuba
from scenes.formats.mitsuba.write import save_mitsuba, save_mitsuba3
from scenes.formats.text.format import Format

MITSUBA = Format("Mitsuba", (".xml",), load_mitsuba, save_mitsuba)
MITSUBA_3 = Format("Mitsuba 3", (), load_mitsuba, save_mitsuba3)
MITSUBA_DICTIONARY = Format("Mitsuba 3 as dictionaries", (".json",), load_dictionary, None)
