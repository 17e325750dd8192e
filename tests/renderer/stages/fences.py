"""Memory between inaccessible pages: native code that reads or writes beyond an array crashes the process.

Unwritten memory holds a pattern, so a result that depends on it changes with the pattern.
"""

from __future__ import annotations

import ctypes
import mmap
from types import ModuleType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

_PAGE = mmap.PAGESIZE
_CACHE = "level", "index", "time_s", "dead", "color", "coefficients", "slot_of_node"


class Fences:
    """Makes arrays that end, or begin, right at an inaccessible page.

    Attributes:
        at_end: whether arrays end at such a page, so that the first byte behind them is out of bounds; otherwise it is
            the last one before them.
        fill: the byte that new memory is filled with.
    """

    def __init__(self, at_end: bool, fill: int) -> None:
        self.at_end, self.fill = at_end, fill
        self._regions: list[mmap.mmap] = []
        self._protect = ctypes.CDLL(None, use_errno=True).mprotect
        self._protect.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int

    def array(self, shape: tuple[int, ...], dtype: Any, fill: int | None = None) -> NDArray:
        """A fenced NumPy array; its memory stays as long as this object."""
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        room = -(-max(size, 1) // _PAGE) * _PAGE
        region = mmap.mmap(-1, room + 2 * _PAGE)
        self._regions.append(region)
        start = ctypes.addressof(ctypes.c_char.from_buffer(region))
        for page in (start, start + _PAGE + room):
            if self._protect(page, _PAGE, 0):
                raise OSError(ctypes.get_errno(), "mprotect")
        first = _PAGE + (room - size if self.at_end else 0)
        ctypes.memset(start + first, self.fill if fill is None else fill, size)
        return np.frombuffer(region, dtype, int(np.prod(shape)), first).reshape(shape)

    def tensor(self, values: Tensor) -> Tensor:
        """A fenced copy."""
        made = torch.from_numpy(self.array(tuple(values.shape), values.numpy().dtype))
        return made.copy_(values)

    def empty(self, *shape: int, dtype: torch.dtype = torch.float32) -> Tensor:
        """Stands in for ``torch.empty``."""
        return torch.from_numpy(self.array(shape, torch.empty(0, dtype=dtype).numpy().dtype))

    def zeros(self, *shape: int, dtype: torch.dtype = torch.float32) -> Tensor:
        """Stands in for ``torch.zeros``."""
        return self.empty(*shape, dtype=dtype).zero_()

    def zero_array(self, count: int, dtype: Any = np.float64) -> NDArray:
        """Stands in for ``numpy.zeros``."""
        return self.array((count,), dtype, 0)

    def around_cache(self, cache: Any) -> None:
        """Moves a framelet cache between fences."""
        for name in _CACHE:
            setattr(cache, name, self.tensor(getattr(cache, name)))


class Replaced:
    """A module with some of its functions replaced."""

    def __init__(self, module: ModuleType, **replaced: Any) -> None:
        self.__dict__.update(replaced, _module=module)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)
