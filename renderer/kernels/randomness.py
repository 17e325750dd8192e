"""Random numbers of secondary rays: counter-based, and stratified over a group of samples.

A group is a set of samples that are viewed together: those of one framelet, or of one pixel of a frame. The numbers of
a sample are a function of the position and time of its group's first sample, of its index in the group and of a
purpose. So they do not depend on the batch, the thread or the machine, and the same samples get the same numbers as a
framelet and as part of a frame.

Source of the stratification: Kensler 2013, "Correlated Multi-Jittered Sampling".
"""

from __future__ import annotations

import warp as wp

from renderer.layout.structs import Draw

# larger literals would be taken for int32
_MIX_A = wp.constant(wp.uint32(0x7FEB352D))
_MIX_B = wp.constant(wp.uint32(0x846CA68B))
_SPREAD = wp.constant(wp.uint32(0x9E3779B9))
_OFFSET = wp.constant(wp.uint32(0x85EBCA6B))
_ROUND = wp.constant(wp.uint32(0x68E31DA4))
_POINT = wp.constant(wp.uint32(0x51ED270B))

PURPOSE_LENS, PURPOSE_REFLECT, PURPOSE_REFRACT, PURPOSE_LIGHT = range(4)


@wp.func
def mixed(x: wp.uint32) -> wp.uint32:
    """A mixing bijection of 32-bit words; constants by Wellons 2018 ("lowbias32")."""
    x = (x ^ (x >> wp.uint32(16))) * _MIX_A
    x = (x ^ (x >> wp.uint32(15))) * _MIX_B
    return x ^ (x >> wp.uint32(16))


@wp.func
def hashed(a: wp.uint32, b: wp.uint32) -> wp.uint32:
    """A hash of two words."""
    return mixed(a ^ (mixed(b + _SPREAD) + _OFFSET))


@wp.func
def unit_interval(word: wp.uint32) -> wp.float32:
    """A number in [0, 1) from 24 bits of a word."""
    return wp.float32(word >> wp.uint32(8)) * wp.float32(5.9604644775390625e-08)


@wp.func
def permuted(index: wp.int32, length: wp.int32, key: wp.uint32) -> wp.int32:
    """The image of ``index`` under a permutation of ``length`` numbers, selected by ``key``.

    Bijections on the next power of two are iterated until the result is below ``length`` (cycle walking).
    """
    bits = wp.uint32(1)
    while (wp.uint32(1) << bits) < wp.uint32(length):
        bits = bits + wp.uint32(1)
    mask = (wp.uint32(1) << bits) - wp.uint32(1)
    half = (bits + wp.uint32(1)) / wp.uint32(2)
    x = wp.uint32(index)
    again = wp.bool(True)
    while again:
        word = wp.uint32(key)
        for _ in range(4):
            x = (x + word) & mask
            x = (x * ((word >> wp.uint32(7)) | wp.uint32(1))) & mask
            x = x ^ (x >> half)
            word = mixed(word + _ROUND)
        again = x >= wp.uint32(length)
    return wp.int32(x)


@wp.func
def group_draw(seed: wp.uint32, position: wp.vec2, time_s: wp.float64, index: wp.int32, count: wp.int32) -> Draw:
    """The draw of sample ``index`` in a group of ``count`` samples, whose first sample has this position and time."""
    instant = wp.cast(time_s, wp.uint64)
    key = hashed(seed, wp.cast(position[0], wp.uint32))
    key = hashed(key, wp.cast(position[1], wp.uint32))
    key = hashed(key, wp.uint32(instant & wp.uint64(0xFFFFFFFF)))
    draw = Draw()
    draw.key = hashed(key, wp.uint32(instant >> wp.uint64(32)))
    draw.index = index
    draw.count = count
    return draw


@wp.func
def branched(draw: Draw, ray: wp.int32, rays: wp.int32, kind: wp.int32) -> Draw:
    """The draw of one of ``rays`` secondary rays of a sample; those of a group are stratified together."""
    child = Draw()
    child.key = hashed(draw.key, wp.uint32(kind + 1))
    child.index = draw.index * rays + ray
    child.count = draw.count * rays
    return child


@wp.func
def draw_2d(draw: Draw, purpose: wp.int32) -> wp.vec2:
    """A point in the unit square, correlated multi-jittered over the group."""
    key = hashed(draw.key, wp.uint32(purpose) + _POINT)
    columns = wp.max(wp.int32(wp.sqrt(wp.float32(draw.count))), 1)
    rows = (draw.count + columns - 1) / columns
    # over all cells, even where there are more cells than samples: omitted cells must be random
    cell = permuted(draw.index, columns * rows, key)
    column = cell % columns
    row = cell / columns
    # the position in a cell's column and row: a permutation of the rows and of the columns
    down = permuted(row, rows, hashed(key, wp.uint32(2)))
    across = permuted(column, columns, hashed(key, wp.uint32(1)))
    noise = hashed(key, wp.uint32(cell) + wp.uint32(3))
    x = (wp.float32(column) + (wp.float32(down) + unit_interval(noise)) / wp.float32(rows)) / wp.float32(columns)
    y = (wp.float32(row) + (wp.float32(across) + unit_interval(mixed(noise))) / wp.float32(columns)) / wp.float32(rows)
    # sums may round to 1
    return wp.vec2(wp.min(x, 0.99999994), wp.min(y, 0.99999994))


@wp.func
def cell_2d(draw: Draw, purpose: wp.int32, cell: wp.int32, cells: wp.int32) -> wp.vec2:
    """A random point in one of ``cells`` squared cells of the unit square."""
    key = hashed(hashed(draw.key, wp.uint32(purpose)), wp.uint32(draw.index))
    noise = hashed(key, wp.uint32(cell))
    x = (wp.float32(cell % cells) + unit_interval(noise)) / wp.float32(cells)
    y = (wp.float32(cell / cells) + unit_interval(mixed(noise))) / wp.float32(cells)
    return wp.vec2(wp.min(x, 0.99999994), wp.min(y, 0.99999994))


@wp.func
def cone_direction(axis: wp.vec3, cos_half_angle: wp.float32, sample: wp.vec2) -> wp.vec3:
    """A unit direction in a cone about a unit axis, uniform in solid angle."""
    height = 1.0 - sample[0] * (1.0 - cos_half_angle)
    ring = wp.sqrt(wp.max(1.0 - height * height, 0.0))
    turn = 2.0 * wp.pi * sample[1]
    # a frame about the axis (Duff et al. 2017)
    sign = wp.where(axis[2] >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + axis[2])
    b = axis[0] * axis[1] * a
    first = wp.vec3(1.0 + sign * axis[0] * axis[0] * a, sign * b, -sign * axis[0])
    second = wp.vec3(b, sign + axis[1] * axis[1] * a, -axis[1])
    return wp.normalize(ring * wp.cos(turn) * first + ring * wp.sin(turn) * second + height * axis)
