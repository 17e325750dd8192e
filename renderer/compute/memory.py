"""Tensors that recorded launches know by address only, kept alive by name."""

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
