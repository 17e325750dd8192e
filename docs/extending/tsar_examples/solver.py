"""A transport solver that grants both sides half of what the lesser one wants, so that densities change slowly."""

import torch


def cautious(desired: torch.Tensor, bound: torch.Tensor, surplus: float, surplus_max: float) -> torch.Tensor:
    """The change granted, which sums to zero, has the sign of ``desired``, and stays within ``bound``."""
    asks, frees = desired.clamp(min=0.0), (-desired).clamp(min=0.0)
    flux = 0.5 * min(float(asks.sum()), float(frees.sum()))
    if flux == 0.0:
        return torch.zeros_like(desired)
    return asks * (flux / asks.sum()) - frees * (flux / frees.sum())
