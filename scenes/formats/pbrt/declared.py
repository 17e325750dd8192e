"""Declaration of the PBRT formats."""

from scenes.formats.pbrt.load import load_pbrt
from scenes.formats.pbrt.v4_write import save_pbrt4
from scenes.formats.pbrt.write import save_pbrt
from scenes.formats.text.format import Format

PBRT = Format("PBRT", (".pbrt",), load_pbrt, save_pbrt)
PBRT_4 = Format("PBRT v4", (), load_pbrt, save_pbrt4)
