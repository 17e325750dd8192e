"""Recorded launches: arguments of every kind arrive, both constant and varying ones."""

from __future__ import annotations

import sys

import numpy as np
import warp as wp

from renderer.compute import device as devices
from renderer.compute.launching import Address, Command

wp.set_module_options({"enable_backward": False})


@wp.struct
class Pair:
    first: wp.float64
    second: wp.int32


@wp.kernel
def copy_out(
    out: Address, fixed: Pair, small: wp.int32, real: wp.float64, single: wp.float32, large: wp.int64, where: Address
):
    numbers = wp.array(ptr=out, shape=(7,), dtype=wp.float64)
    numbers[0] = fixed.first
    numbers[1] = wp.float64(fixed.second)
    numbers[2] = wp.float64(small)
    numbers[3] = real
    numbers[4] = wp.float64(single)
    numbers[5] = wp.float64(large)
    numbers[6] = wp.float64(where)


def test_fixed_and_varying_arguments_arrive() -> None:
    devices.load_kernels(sys.modules[__name__], "cpu")
    out, pair = np.zeros(7), Pair()
    pair.first, pair.second = 0.1, -7
    command = Command(copy_out, out.ctypes.data, pair)
    for small, real, single, large, where in ((3, 0.2, 0.5, -(2**40), 2**50), (-1, -1e300, 2.0**-20, 5, 0)):
        command(small, real, single, large, where)
        assert out.tolist() == [0.1, -7.0, small, real, single, large, where]
    command.set(4, 0.25, 0.5, 6, 7)
    out[:] = 0.0
    command.launch()
    assert out.tolist() == [0.1, -7.0, 4.0, 0.25, 0.5, 6.0, 7.0]


def test_a_launch_without_varying_arguments() -> None:
    devices.load_kernels(sys.modules[__name__], "cpu")
    out, pair = np.zeros(7), Pair()
    Command(copy_out, out.ctypes.data, pair, 1, 2.0, 3.0, 4, 5)()
    assert out.tolist() == [0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
