"""Where the squared error of an image lies: shares that add up to it, and the least that its latency leaves.

With D the image on the display, R the picture now, R' the picture at the time that the image shows, and S(R') what the
image's own blends of pixels would show of R', all display-encoded,

    e = D - R = (D - S(R')) + (S(R') - R') + (R' - R)
              =  estimates  +      blur    +  latency.

The share of a term is the mean of ``term * e`` over pixels and channels. Shares add up to the mean of ``e²``, and each
is what putting the term right takes away, averaged over all orders in which the three could be put right (its Shapley
value). A share is negative where a term offsets the others. The estimates' share is divided by the pixel, so that it is
exact too: places that came into sight, else places where the light changed, else the rest, where only too few samples
or samples beside their pixels are left to blame: aliasing.

:mod:`analysis.metrics.causes` asks another question, by the age of each place's samples, and its parts are mean squares
with a remainder.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from analysis.metrics.quality import encode

SHARES = ("latency", "blur", "disocclusion", "shadows", "aliasing")
"""Parts of the error, by name."""


@dataclass(frozen=True)
class Places:
    """Pixels whose past differs; none is both.

    Attributes:
        uncovered: what they show was hidden, or outside the picture, shortly before.
        relit: what they show was seen then, and the first light reached it then or reaches it now, not both.
    """

    uncovered: Bool[Tensor, "h w"]
    relit: Bool[Tensor, "h w"]


def budget(
    shown: Float[Tensor, "h w 3"],
    carried: Float[Tensor, "h w 3"],
    late: Float[Tensor, "h w 3"],
    now: Float[Tensor, "h w 3"],
    places: Places,
) -> dict[str, float]:
    """Shares of one image's error.

    Args:
        shown: the image on the display, linear; what is not finite counts as 0.
        carried: what its blends show of ``late``, linear.
        late: the truth at the time that the image shows, linear.
        now: the truth, linear.
        places: pixels whose past differs, at the time that the image shows.

    Returns:
        Each of :data:`SHARES`, squared display-encoded values; they add up to the mean squared error. ``floor``, the
        mean squared error of ``late``; ``uncovered`` and ``relit``, shares of the pixels.
    """
    display, kept, old, wanted = (
        encode(image).to(torch.float64) for image in (shown.nan_to_num(0.0, 0.0, 0.0), carried, late, now)
    )
    error = display - wanted

    def share(term: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w"]:
        return (term * error).mean(2)

    estimates = share(display - kept)
    count = estimates.numel()
    rest = ~(places.uncovered | places.relit)
    parts = {"disocclusion": places.uncovered, "shadows": places.relit, "aliasing": rest}
    return {
        "latency": float(share(old - wanted).mean()),
        "blur": float(share(kept - old).mean()),
        **{name: float(estimates[place].sum()) / count for name, place in parts.items()},
        "floor": float((old - wanted).square().mean()),
        "uncovered": int(places.uncovered.sum()) / count,
        "relit": int(places.relit.sum()) / count,
    }
