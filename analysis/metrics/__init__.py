"""Metrics by name, which are measured beside the mean squared errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from tsar.config import closed_choices
from tsar.named import Named

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from torch import Tensor

    from analysis.metrics.display_model import DisplayModel

    OfImage = Callable[[Tensor, Tensor], float]
    OfSequence = Callable[[NDArray[np.uint8], NDArray[np.uint8], float, DisplayModel], float]
else:
    OfImage = OfSequence = Any


@dataclass(frozen=True)
@closed_choices("metric.")
class Metric:
    """A measure of the difference between a display and the reference.

    Attributes:
        better: whether lower or higher values are better.
        image: function of two display-encoded images in [0, 1], ``(h, w, 3)``, shown and reference; None for a metric
            of sequences.
        sequence: function of two sequences of display-encoded images ``(count, h, w, 3)`` uint8, their rate in Hz and
            the display; None for a metric of images.
        unit: unit of its values; empty for plain numbers.
    """

    better: Literal["lower", "higher"]
    image: OfImage | None = None
    sequence: OfSequence | None = None
    unit: str = ""

    def __post_init__(self) -> None:
        if (self.image is None) == (self.sequence is None):
            raise ValueError("metric: expected a function of images or one of sequences, got both or neither")

    def of_image(self, shown: Tensor, reference: Tensor) -> float:
        """Value of one image.

        Raises:
            ValueError: this is a metric of sequences.
        """
        if self.image is None:
            raise ValueError("metric: expected one of single images, this one measures sequences")
        return self.image(shown, reference)

    def of_sequence(
        self, shown: NDArray[np.uint8], reference: NDArray[np.uint8], rate_hz: float, display: DisplayModel
    ) -> float:
        """Value of a sequence.

        Raises:
            ValueError: this is a metric of single images.
        """
        if self.sequence is None:
            raise ValueError("metric: expected one of sequences, this one measures single images")
        return self.sequence(shown, reference, rate_hz, display)


METRICS: Named[Metric] = Named(
    "metric",
    "tsar.metrics",
    {
        "flip": "analysis.metrics.perceptual:FLIP",
        "ssim": "analysis.metrics.perceptual:SSIM",
        "jod": "analysis.metrics.perceptual:JOD",
    },
)
