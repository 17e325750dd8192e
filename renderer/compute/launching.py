"""Launches that cost little: recorded once, their arguments set anew each time.

``wp.launch`` checks and packs all its arguments, which takes as long as some of these kernels run.
"""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
import warp as wp
from numpy.typing import NDArray
from torch import Tensor

from tsar.config import TsarConfig

Address = wp.uint64
"""In a kernel: of the first element of a contiguous tensor on the CPU."""


def address(name: str, values: Tensor | NDArray, dtype: torch.dtype, count: int) -> int:
    """Where an array's elements lie for native code, which takes their kind and number on trust.

    Args:
        name: of the array, for the error.
        values: the array, which the caller keeps alive.
        dtype, count: kind and number of elements that are read or written there.

    Raises:
        ValueError: unless the array has these, one after the other, on the CPU.
    """
    if isinstance(values, np.ndarray):
        values = torch.from_numpy(values)
    if values.dtype is not dtype or values.numel() != count or not values.is_cpu or not values.is_contiguous():
        raise ValueError(f"{name}: expected {count} contiguous elements of {dtype} on cpu, got {_described(values)}")
    return values.data_ptr()


def _described(values: Tensor) -> str:
    gaps = "" if values.is_contiguous() else f" with strides {tuple(values.stride())}"
    return f"shape {tuple(values.shape)}{gaps} of {values.dtype} on {values.device}"


def shared(values: NDArray, dtype: type) -> wp.array:
    """A contiguous NumPy array as a Warp one on the CPU, in the same memory.

    Raises:
        ValueError: if its elements are of another kind, or do not lie one after the other.
    """
    made = wp.array(values, dtype=dtype, device="cpu", copy=False)
    # where the kind differs Warp makes a copy unasked; an empty array has no address
    if values.size and (made.ptr != values.ctypes.data or not made.is_contiguous):
        raise ValueError(
            f"expected contiguous elements of {dtype.__name__}, got shape {values.shape} of {values.dtype}"
        )
    return made


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

    Attributes:
        launch: runs the kernel with the arguments set last.
        entry: addresses of the compiled kernel and of its two parameters, to launch it from elsewhere.
    """

    def __init__(self, kernel: Any, *fixed: Any, size: int = 1) -> None:
        """Records a launch of ``kernel`` over ``size`` threads whose first arguments are ``fixed``."""
        varying = len(kernel.adj.args) - len(fixed)
        self._record = wp.launch(kernel, size, inputs=[*fixed, *[0] * varying], device="cpu", record_cmd=True)
        bounds, *values = self._record.params
        # What Warp makes of these at each launch, made once: a structure of all arguments, by name.
        names = (argument.label for argument in kernel.adj.args)
        layout = [(name, type(value)) for name, value in zip(names, values, strict=True)]
        arguments = type("Arguments", (ctypes.Structure,), {"_fields_": layout})(*values)
        self._set = partial(_packer(type(arguments), len(fixed)), arguments)
        forward = self._record.hooks.forward
        self.launch = partial(forward, ctypes.byref(bounds), ctypes.byref(arguments))
        function = ctypes.cast(forward, ctypes.c_void_p).value
        self.entry = function, ctypes.addressof(bounds), ctypes.addressof(arguments)

    def set(self, *arguments: float) -> None:
        """Sets the last arguments."""
        self._set(*arguments)

    def __call__(self, *arguments: float) -> None:
        """Launches with these last arguments."""
        self._set(*arguments)
        self.launch()


def _packer(structure: type[ctypes.Structure], first: int) -> Callable[..., None]:
    """A function of such a structure and of numbers, which writes these into its fields from number ``first`` on."""
    layout, end = "=", 0
    for number, (name, kind) in enumerate(structure._fields_):
        offset = getattr(structure, name).offset
        if number >= first:
            layout += "x" * (offset - end if number > first else 0) + _CODES[kind]
        end = offset + ctypes.sizeof(kind)
    start = getattr(structure, structure._fields_[first][0]).offset if first < len(structure._fields_) else 0
    pack = struct.Struct(layout).pack_into
    return lambda target, *numbers: pack(target, start, *numbers)


class Record:
    """A structure of native code that launches read by its address: words of eight bytes.

    Attributes:
        address: where it lies.
    """

    def __init__(self, layout: str) -> None:
        """Takes the kinds of its words as :mod:`struct` names them."""
        self._pack = struct.Struct("=" + layout).pack_into
        self._bytes = ctypes.create_string_buffer(struct.calcsize("=" + layout))
        self.address = ctypes.addressof(self._bytes)

    def set(self, *words: float) -> None:
        """Sets all words."""
        self._pack(self._bytes, 0, *words)


_CODES = {
    ctypes.c_int32: "i",
    ctypes.c_int64: "q",
    ctypes.c_uint64: "Q",
    ctypes.c_float: "f",
    ctypes.c_double: "d",
}
"""Kinds of numbers that a launch takes, as :mod:`struct` names them."""
