"""Launches that cost little: recorded once, their arguments set anew each time.

``wp.launch`` checks and packs all its arguments, which takes as long as some of these kernels run.
"""

from __future__ import annotations

from typing import Any

import warp as wp
from numpy.typing import NDArray
from torch import Tensor

from tsar.config import TsarConfig

Address = wp.uint64
"""In a kernel: of the first element of a contiguous tensor on the CPU."""


def address(tensor: Tensor) -> int:
    """Where a tensor's elements lie, one after the other, on the CPU.

    Raises:
        ValueError: if they lie otherwise.
    """
    if not tensor.is_contiguous() or tensor.is_cuda:
        raise ValueError(f"expected a contiguous tensor on the CPU, got strides {tensor.stride()} on {tensor.device}")
    return tensor.data_ptr()


def shared(values: NDArray, dtype: type) -> wp.array:
    """A contiguous NumPy array as a Warp one on the CPU, in the same memory."""
    return wp.array(values, dtype=dtype, device="cpu", copy=False)


def require_same(config: TsarConfig, own: TsarConfig) -> None:
    """Refuses a run that compiled stages were not made for.

    Raises:
        ValueError: if the configurations differ.
    """
    if config is not own and config != own:
        raise ValueError("compiled stages: expected the configuration that they were made for, got another")


class Command:
    """A kernel to be launched on the CPU over and over; its arguments are not to be set by two threads at once.

    Its first arguments stay as they are, the others are plain numbers: values, or addresses of tensors, which the
    caller keeps alive and contiguous during the launch.
    """

    def __init__(self, kernel: Any, *fixed: Any, size: int = 1) -> None:
        """Records a launch of ``kernel`` over ``size`` threads whose first arguments are ``fixed``."""
        varying = len(kernel.adj.args) - len(fixed)
        self._launch = wp.launch(kernel, size, inputs=[*fixed, *[0] * varying], device="cpu", record_cmd=True)
        # Plain C numbers, which may be set in place; the first parameter is the size of the launch.
        self._varying = self._launch.params[1 + len(fixed) :]
        self.launch = self._launch.launch

    def set(self, *arguments: float) -> None:
        """Sets the last arguments."""
        for parameter, value in zip(self._varying, arguments, strict=True):
            parameter.value = value

    def __call__(self, *arguments: float) -> None:
        """Launches with these last arguments."""
        self.set(*arguments)
        self.launch()
