"""The display that a perceptual score assumes. Imports little, because command lines are made from it."""

from __future__ import annotations

from dataclasses import dataclass

from tsar.config import require


@dataclass(frozen=True)
class DisplayModel:
    """The display that a score assumes; every record names it."""

    name: str = "standard_fhd"
    """A display of ColorVideoVDP: size, distance, luminance."""
    rate_hz: float = 60.0
    """Refresh rate, Hz. The same pixels score differently at another rate."""

    def __post_init__(self) -> None:
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
