"""Tensors that recorded launches refer to by address only, kept alive by name; and recycled memory."""

from __future__ import annotations

import torch
from torch import Tensor

from renderer.compute.launching import address


class Memory:
    """Keeps tensors alive for its own lifetime, and gives their addresses."""

    def __init__(self) -> None:
        self._kept: dict[str, Tensor] = {}

    def keep(self, name: str, tensor: Tensor, dtype: torch.dtype, count: int) -> int:
        """Keeps a tensor, made contiguous, and returns its address.

        Raises:
            ValueError: as :func:`renderer.compute.launching.address`.
        """
        self._kept[name] = tensor.contiguous()
        return address(name, self._kept[name], dtype, count)

    def room(self, name: str, count: int, dtype: torch.dtype = torch.float32) -> int:
        """Address of ``count`` uninitialised elements."""
        return self.keep(name, torch.empty(count, dtype=dtype), dtype, count)

    def zeros(self, name: str, count: int, dtype: torch.dtype = torch.float32) -> int:
        """Address of ``count`` elements, initially zero."""
        return self.keep(name, torch.zeros(count, dtype=dtype), dtype, count)


class Recycled:
    """Blocks of memory of one size that are reused once no tensor refers to them.

    The system maps new memory page by page at the first access, which takes longer than writing to it.
    """

    KEPT = 4
    """Maximum number of blocks that are kept: two for the states before and after a cycle, and two for states in use
    elsewhere."""

    def __init__(self, size: int) -> None:
        """Creates a pool of blocks of ``size`` bytes."""
        self._size = size
        self._blocks: list[tuple[Tensor, int]] = []

    def block(self) -> Tensor:
        """An uninitialised block of bytes; it belongs to the caller until the last tensor that shares it is gone."""
        for block, idle in self._blocks:
            if _uses(block) == idle:
                return block.view(-1)
        made = torch.empty(self._size, dtype=torch.uint8)
        self._blocks = [*self._blocks, (made, _uses(made))][-self.KEPT :]
        return made.view(-1)


def _uses(block: Tensor) -> int:
    return torch._C._storage_Use_Count(block.untyped_storage()._cdata)  # type: ignore[attr-defined]
