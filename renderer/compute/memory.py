"""Tensors that recorded launches know by address only, kept alive by name; and memory that is used again."""

from __future__ import annotations

import torch
from torch import Tensor

from renderer.compute.launching import address


class Memory:
    """Holds tensors for as long as it lives itself, and says where they lie."""

    def __init__(self) -> None:
        self._kept: dict[str, Tensor] = {}

    def keep(self, name: str, tensor: Tensor, dtype: torch.dtype, count: int) -> int:
        """Address of a tensor, made contiguous.

        Raises:
            ValueError: as :func:`renderer.compute.launching.address`.
        """
        self._kept[name] = tensor.contiguous()
        return address(name, self._kept[name], dtype, count)

    def room(self, name: str, count: int, dtype: torch.dtype = torch.float32) -> int:
        """Address of ``count`` elements that hold anything at first."""
        return self.keep(name, torch.empty(count, dtype=dtype), dtype, count)

    def zeros(self, name: str, count: int, dtype: torch.dtype = torch.float32) -> int:
        """Address of ``count`` elements that are zero at first."""
        return self.keep(name, torch.zeros(count, dtype=dtype), dtype, count)


class Recycled:
    """Blocks of one size that are handed out again when no tensor lies in them any more.

    New memory comes from the system page by page at the first touch, which takes longer than writing to it does.
    """

    KEPT = 4
    """Most blocks that are kept: of the state before and after a cycle, and of two that somebody looks at."""

    def __init__(self, size: int) -> None:
        """Blocks of ``size`` bytes."""
        self._size = size
        self._blocks: list[tuple[Tensor, int]] = []

    def block(self) -> Tensor:
        """Bytes that hold anything; they are the caller's until the last tensor that shares them is gone."""
        for block, idle in self._blocks:
            if _uses(block) == idle:
                return block.view(-1)
        made = torch.empty(self._size, dtype=torch.uint8)
        self._blocks = [*self._blocks, (made, _uses(made))][-self.KEPT :]
        return made.view(-1)


def _uses(block: Tensor) -> int:
    return torch._C._storage_Use_Count(block.untyped_storage()._cdata)  # type: ignore[attr-defined]
