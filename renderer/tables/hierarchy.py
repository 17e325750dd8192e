"""A tree of boxes over the instances of a group, laid out for traversal without a stack.

Nodes are in depth-first order, and each has the index of the end of its subtree: a ray that hits a box continues with
the next node, and one that misses it continues after the subtree.

Source: Smits 1998, "Efficiency Issues for Ray Tracing"; splits after Wald 2007, "On fast Construction of SAH-based
Bounding Volume Hierarchies".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Boxes = NDArray[np.float64]
Items = NDArray[np.int64]


@dataclass
class Node:
    """A box over one item or several.

    Attributes:
        lower, upper: ``(3,)`` corners.
        skip: index of the first node after this one's subtree.
        item: the boxed item of a leaf, -1 for inner nodes.
    """

    lower: Boxes
    upper: Boxes
    skip: int
    item: int


def box_tree(lower: Boxes, upper: Boxes, enclosing: float) -> list[Node]:
    """Builds a tree; nodes are in depth-first order.

    Args:
        lower, upper: ``(n, 3)`` corners of the items' boxes.
        enclosing: half the surface area of a bound that rays are known to hit before they reach the tree.

    Returns:
        One leaf for each item, and inner nodes where they save more tests than they cost. Of two siblings the one with
        the greater surface area comes first: a near hit in it saves the test of the other.
    """
    nodes: list[Node] = []
    pending: list[tuple[Items, float] | Node] = [(np.arange(len(lower)), enclosing)]
    while pending:
        entry = pending.pop()
        if isinstance(entry, Node):  # its whole subtree is laid out
            entry.skip = len(nodes)
            continue
        items, around = entry
        low, high = lower[items].min(axis=0), upper[items].max(axis=0)
        if len(items) == 1:
            nodes.append(Node(low, high, len(nodes) + 1, int(items[0])))
            continue
        surface = float(_surface(low, high))
        if len(items) * (around - surface) > around:  # tests saved, from the share of rays that miss the box
            nodes.append(Node(low, high, 0, -1))
            pending.append(nodes[-1])
            around = surface
        first, second = _halves(lower, upper, items)
        pending += [(second, around), (first, around)]
    return nodes


def _surface(lower: Boxes, upper: Boxes) -> Boxes:
    """Half the surface area of boxes ``(..., 3)``."""
    x, y, z = np.moveaxis(upper - lower, -1, 0)
    return x * y + y * z + z * x


def _halves(lower: Boxes, upper: Boxes, items: Items) -> tuple[Items, Items]:
    """Splits items where the surface areas of both boxes, weighted by their counts, have the least sum; the greater
    half comes first."""
    count = np.arange(1, len(items))
    best = (np.inf, items, 1, False)
    for axis in range(3):
        order = items[np.argsort(lower[items, axis] + upper[items, axis], kind="stable")]
        low, high = lower[order], upper[order]
        left = _surface(np.minimum.accumulate(low), np.maximum.accumulate(high))[:-1]
        right = _surface(np.minimum.accumulate(low[::-1]), np.maximum.accumulate(high[::-1]))[-2::-1]
        cost = left * count + right * count[::-1]
        cut = int(np.argmin(cost))
        if cost[cut] < best[0]:
            best = (cost[cut], order, cut + 1, bool(right[cut] > left[cut]))
    _, order, cut, turned = best
    return (order[cut:], order[:cut]) if turned else (order[:cut], order[cut:])
