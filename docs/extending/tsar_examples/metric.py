"""A metric: the error of the differences between neighbouring pixels."""

from analysis import Metric


def edges(shown, reference) -> float:
    """Mean absolute error of horizontal and vertical differences of display-encoded images ``(h, w, 3)``."""
    off = shown - reference
    return float(off.diff(dim=0).abs().mean() + off.diff(dim=1).abs().mean())


EDGES = Metric(better="lower", image=edges)
