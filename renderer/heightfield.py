"""Height fields: rays marched through the relief below a rectangle.

In the unit space of the rectangle the relief is the sheet ``z = (h(x, y) - 1) depth`` over the square [-1, 1]², ``h``
bilinear between the samples of its map. It is marched in even steps until the ray has passed through the sheet, from
either side, and the crossing is then found by secants (Policarpo, Oliveira and Comba 2005; Tatarchuk 2006). The sheet
has no walls: rays that leave over the border go on.
"""

from __future__ import annotations

import warp as wp

from renderer.structs import Hit, InstanceRecord, LevelRecord, LocalSurface, ReliefRecord, SceneData

_TINY = wp.constant(1.0e-20)
_SECANTS = wp.constant(32)  # at most; a few are enough where the sheet is smooth
_FEWEST_STEPS = wp.constant(4)


@wp.func
def height_sample(scene: SceneData, level: LevelRecord, column: wp.int32, row: wp.int32) -> wp.float32:
    """One sample of the map; beyond the border the nearest."""
    x = wp.clamp(column, 0, level.width - 1)
    y = wp.clamp(row, 0, level.height - 1)
    return scene.texels[level.first_texel + y * level.width + x][0]


@wp.func
def height_at(scene: SceneData, level: LevelRecord, x: wp.float32, y: wp.float32) -> wp.float32:
    """Height between 0 and 1 at a point of the square; row 0 of the map is at ``y = 1``."""
    across = (0.5 * x + 0.5) * wp.float32(level.width) - 0.5
    down = (0.5 - 0.5 * y) * wp.float32(level.height) - 0.5
    left = wp.floor(across)
    top = wp.floor(down)
    column = wp.int32(left)
    row = wp.int32(top)
    fx = across - left
    upper = height_sample(scene, level, column, row) * (1.0 - fx) + height_sample(scene, level, column + 1, row) * fx
    lower = height_sample(scene, level, column, row + 1)
    lower = lower * (1.0 - fx) + height_sample(scene, level, column + 1, row + 1) * fx
    return upper + (lower - upper) * (down - top)


@wp.func
def above_sheet(
    scene: SceneData, relief: ReliefRecord, origin: wp.vec3, direction: wp.vec3, t: wp.float32
) -> wp.float32:
    """How far a point of a ray is above the sheet, along z."""
    p = origin + t * direction
    return p[2] - (height_at(scene, scene.levels[relief.level], p[0], p[1]) - 1.0) * relief.depth


@wp.func
def crossing(
    scene: SceneData,
    relief: ReliefRecord,
    origin: wp.vec3,
    direction: wp.vec3,
    before: wp.float32,
    after: wp.float32,
    gap_before: wp.float32,
    gap_after: wp.float32,
) -> wp.float32:
    """Where a ray passes through the sheet, between two points on either side of it.

    Regula falsi that halves the weight of an end which stays (the Illinois rule of Dowell and Jarratt 1971), so that
    it always closes in.
    """
    low = wp.float32(before)
    high = wp.float32(after)
    gap_low = wp.float32(gap_before)
    gap_high = wp.float32(gap_after)
    t = wp.float32(after)
    kept = wp.int32(0)
    for _ in range(_SECANTS):
        t = low + (high - low) * (gap_low / (gap_low - gap_high))
        t = wp.clamp(t, low, high)
        gap = above_sheet(scene, relief, origin, direction, t)
        if wp.abs(gap) < 1.0e-7 * relief.depth or t == low or t == high:
            break
        if (gap < 0.0) == (gap_low < 0.0):
            low = t
            gap_low = gap
            if kept == 1:
                gap_high = 0.5 * gap_high
            kept = 1
        else:
            high = t
            gap_high = gap
            if kept == 2:
                gap_low = 0.5 * gap_low
            kept = 2
    return t


@wp.func
def relief_distance(
    scene: SceneData, record: InstanceRecord, origin: wp.vec3, direction: wp.vec3, reach: wp.float32
) -> wp.float32:
    """Distance along a unit direction to a relief in its unit space, negative for none before ``reach``.

    The whole width of the relief is crossed in its number of steps, a part of it in as many fewer, and a ray straight
    down in a few. What is thinner than a step may be missed.
    """
    relief = scene.reliefs[record.relief]
    near = wp.float32(0.0)
    far = wp.float32(reach)
    for axis in range(3):
        low = wp.float32(-1.0)
        high = wp.float32(1.0)
        if axis == 2:
            # a little more than the sheet fills, so that its highest and lowest parts are not on the very border
            low = -1.0001 * relief.depth
            high = 0.0001 * relief.depth
        if wp.abs(direction[axis]) > _TINY:
            a = (low - origin[axis]) / direction[axis]
            b = (high - origin[axis]) / direction[axis]
            near = wp.max(near, wp.min(a, b))
            far = wp.min(far, wp.max(a, b))
        elif origin[axis] < low or origin[axis] > high:
            return -1.0
    if near >= far:
        return -1.0
    across = wp.length(wp.vec2(direction[0], direction[1])) * (far - near)
    steps = wp.max(wp.int32(wp.ceil(0.5 * across * wp.float32(relief.steps))), _FEWEST_STEPS)
    step = (far - near) / wp.float32(steps)
    t = wp.float32(near)
    gap = above_sheet(scene, relief, origin, direction, t)
    for number in range(steps):
        next_t = near + wp.float32(number + 1) * step
        next_gap = above_sheet(scene, relief, origin, direction, next_t)
        if (gap < 0.0) != (next_gap < 0.0):
            return crossing(scene, relief, origin, direction, t, next_t, gap, next_gap)
        t = next_t
        gap = next_gap
    return -1.0


@wp.func
def relief_surface(scene: SceneData, record: InstanceRecord, hit: Hit, point: wp.vec3) -> LocalSurface:
    """The surface of a relief at a hit.

    The geometric normal is that of the bilinear patch; the shading normal is taken over a whole sample's width, so that
    it does not jump from one patch to the next.
    """
    relief = scene.reliefs[record.relief]
    level = scene.levels[relief.level]
    wide = 1.0 / wp.float32(level.width)
    tall = 1.0 / wp.float32(level.height)
    x = point[0]
    y = point[1]
    # slopes of the patch: exact from differences within it, of a tenth of a sample
    east = slope(scene, relief, level, x, y, 0.1 * wide, 0.0)
    north = slope(scene, relief, level, x, y, 0.0, 0.1 * tall)
    local = LocalSurface()
    local.position = wp.vec3(x, y, (height_at(scene, level, x, y) - 1.0) * relief.depth)
    local.geometric_normal = wp.normalize(wp.vec3(-east, -north, 1.0))
    local.normal = wp.normalize(
        wp.vec3(
            -slope(scene, relief, level, x, y, wide, 0.0),
            -slope(scene, relief, level, x, y, 0.0, tall),
            1.0,
        )
    )
    local.uv = wp.vec2(0.5 * x + 0.5, 0.5 * y + 0.5)
    local.tangent_u = wp.vec3(2.0, 0.0, 2.0 * east)
    local.tangent_v = wp.vec3(0.0, 2.0, 2.0 * north)
    local.uv_area = 1.0
    return local


@wp.func
def slope(
    scene: SceneData,
    relief: ReliefRecord,
    level: LevelRecord,
    x: wp.float32,
    y: wp.float32,
    dx: wp.float32,
    dy: wp.float32,
) -> wp.float32:
    """Rise of the sheet between two points on either side, over their distance."""
    rise = height_at(scene, level, x + dx, y + dy) - height_at(scene, level, x - dx, y - dy)
    return rise * relief.depth * 0.5 / (dx + dy)
