"""The display that a perceptual score assumes. Imports little, because command lines are made from it."""

from __future__ import annotations

import importlib.util
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tsar.config import require


@dataclass(frozen=True)
class DisplayModel:
    """The display that a score assumes; every record names it."""

    name: str = "standard_fhd"
    """A display of ColorVideoVDP that shows sRGB: size, distance, luminance."""
    rate_hz: float = 60.0
    """Refresh rate, Hz. The same pixels score differently at another rate."""

    def __post_init__(self) -> None:
        if self.name != DisplayModel.name:
            known = srgb_displays()
            require(self.name in known, "display.name", f"one of {', '.join(known)}", self.name)
        require(self.rate_hz in (60.0, 120.0), "display.rate_hz", "60 or 120", self.rate_hz)

    def shows(self, image_rate_hz: float) -> bool:
        """Whether each image of such a rate, Hz, stays on the display for a whole number of refreshes."""
        count = round(self.rate_hz / image_rate_hz)
        return count >= 1 and abs(count * image_rate_hz - self.rate_hz) < 1e-6

    def repeats(self, image_rate_hz: float) -> int:
        """Number of refreshes for which each image stays on the display.

        Raises:
            ConfigError: the number is not an integer.
        """
        fits = self.shows(image_rate_hz)
        require(fits, "reference_rate_hz", f"a whole fraction of the display's {self.rate_hz:g} Hz", image_rate_hz)
        return round(self.rate_hz / image_rate_hz)


@cache
def srgb_displays() -> tuple[str, ...]:
    """Names of the displays of ColorVideoVDP that show sRGB; it has others, to which our codes mean another light."""
    package = importlib.util.find_spec("pycvvdp")
    folder = Path(((package and package.submodule_search_locations) or [""])[0])
    found = json.loads((folder / "vvdp_data" / "display_models.json").read_text(encoding="utf-8"))
    return tuple(name for name, display in found.items() if display.get("colorspace", "sRGB") == "sRGB")
