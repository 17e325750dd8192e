"""Launches with little overhead: each is recorded once, and only its arguments are set anew.

``wp.launch`` checks and packs all its arguments, which takes as long as some of these kernels.
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
"""Type of a kernel's argument: the address of the first element of a contiguous tensor on the CPU."""


def address(name: str, values: Tensor | NDArray, dtype: torch.dtype, count: int) -> int:
    """Address of an array's elements for native code, which does not check their type and number itself.

    Args:
        name: name of the array, for the error.
        values: array, which the caller keeps alive.
        dtype, count: type and number of the elements that are read or written.

    Raises:
        ValueError: unless the array has this type and number of elements, contiguous and on the CPU.
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
    """A contiguous NumPy array as a Warp array on the CPU, in the same memory.

    Raises:
        ValueError: if its elements have another type or are not contiguous.
    """
    made = wp.array(values, dtype=dtype, device="cpu", copy=False)
    # for another type Warp would copy silently; an empty array has no address
    if values.size and (made.ptr != values.ctypes.data or not made.is_contiguous):
        raise ValueError(
            f"expected contiguous elements of {dtype.__name__}, got shape {values.shape} of {values.dtype}"
        )
    return made


def require_same(config: TsarConfig, own: TsarConfig) -> None:
    """Rejects a run with another configuration than that of the compiled stages.

    Raises:
        ValueError: if the configurations differ.
    """
    if config is not own and config != own:
        raise ValueError("compiled stages: expected the configuration for which they were made, got another")


class Command:
    """A kernel that is launched on the CPU repeatedly. Its arguments must not be set by two threads at once.

    Its first arguments are fixed. The others are plain numbers: values, or addresses of tensors, which the caller keeps
    alive and contiguous during the launch.

    Attributes:
        launch: runs the kernel with the current arguments.
        entry: addresses of the compiled kernel and of its two parameters, for launches by native code.
    """

    def __init__(self, kernel: Any, *fixed: Any, size: int = 1) -> None:
        """Records a launch of ``kernel`` over ``size`` threads whose first arguments are ``fixed``."""
        varying = len(kernel.adj.args) - len(fixed)
        self._record = wp.launch(kernel, size, inputs=[*fixed, *[0] * varying], device="cpu", record_cmd=True)
        bounds, *values = self._record.params
        # The structure of all arguments that Warp would create at each launch, created once.
        names = (argument.label for argument in kernel.adj.args)
        layout = [(name, type(value)) for name, value in zip(names, values, strict=True)]
        arguments = type("Arguments", (ctypes.Structure,), {"_fields_": layout})(*values)
        self._set = partial(_packer(type(arguments), len(fixed)), arguments)
        forward = self._record.hooks.forward
        self.launch = partial(forward, ctypes.byref(bounds), ctypes.byref(arguments))
        function = ctypes.cast(forward, ctypes.c_void_p).value
        self.entry = function, ctypes.addressof(bounds), ctypes.addressof(arguments)

    def set(self, *arguments: float) -> None:
        """Sets the variable arguments."""
        self._set(*arguments)

    def __call__(self, *arguments: float) -> None:
        """Launches with these variable arguments."""
        self._set(*arguments)
        self.launch()


def _packer(structure: type[ctypes.Structure], first: int) -> Callable[..., None]:
    """A function that writes numbers into the fields of such a structure, from the field ``first`` on."""
    layout, end = "=", 0
    for number, (name, kind) in enumerate(structure._fields_):
        offset = getattr(structure, name).offset
        if number >= first:
            layout += "x" * (offset - end if number > first else 0) + _CODES[kind]
        end = offset + ctypes.sizeof(kind)
    start = getattr(structure, structure._fields_[first][0]).offset if first < len(structure._fields_) else 0
    pack = struct.Struct(layout).pack_into
    return lambda target, *numbers: pack(target, start, *numbers)


class NativeRecord:
    """A structure of native code that launches read through its address; it consists of words of eight bytes.

    Attributes:
        address: address of the structure.
    """

    def __init__(self, layout: str) -> None:
        """``layout`` has the types of its words, as format characters of :mod:`struct`."""
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
"""Types of numbers that a launch takes, as format characters of :mod:`struct`."""
