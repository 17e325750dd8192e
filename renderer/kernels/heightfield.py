"""Height fields: ray marching through the relief below a rectangle.

In the unit space of the rectangle the relief is the surface ``z = (h(x, y) - 1) depth`` over the square [-1, 1]², with
``h`` interpolated bilinearly between the samples of its map. The ray is marched in equal steps until it has passed
through the surface from either side, and the crossing is then found by the secant method (Policarpo, Oliveira and Comba
2005; Tatarchuk 2006). The surface has two sides and, like a displaced mesh, no walls: rays that leave across the border
continue.

A step is at most ``2 / steps`` of the unit space wide. A ridge or groove that a ray enters and leaves within one step,
narrower than ``width / steps`` samples of the map, may be missed. Of several crossings within one step any may be
returned.
"""

from __future__ import annotations

import warp as wp

from renderer.layout.sizes import TINY
from renderer.layout.structs import Hit, InstanceRecord, LevelRecord, LocalSurface, ReliefRecord, SceneData

_SECANTS = wp.constant(32)  # maximum; a few suffice where the surface is smooth
_FEWEST_STEPS = wp.constant(4)


@wp.func
def height_sample(scene: SceneData, level: LevelRecord, column: wp.int32, row: wp.int32) -> wp.float32:
    """One sample of the map; beyond the border, the nearest one."""
    x = wp.clamp(column, 0, level.width - 1)
    y = wp.clamp(row, 0, level.height - 1)
    return scene.texels[level.first_texel + y * level.width + x][0]


@wp.func
def height_patch(scene: SceneData, level: LevelRecord, x: wp.float32, y: wp.float32) -> wp.vec3:
    """Height in [0, 1] at a point of the square, and its derivatives by x and y in the bilinear patch there.

    Row 0 of the map is at ``y = 1``.
    """
    across = (0.5 * x + 0.5) * wp.float32(level.width) - 0.5
    down = (0.5 - 0.5 * y) * wp.float32(level.height) - 0.5
    left = wp.floor(across)
    top = wp.floor(down)
    column = wp.int32(left)
    row = wp.int32(top)
    fx = across - left
    fy = down - top
    a = height_sample(scene, level, column, row)
    b = height_sample(scene, level, column + 1, row)
    c = height_sample(scene, level, column, row + 1)
    d = height_sample(scene, level, column + 1, row + 1)
    upper = a * (1.0 - fx) + b * fx
    lower = c * (1.0 - fx) + d * fx
    east = ((b - a) * (1.0 - fy) + (d - c) * fy) * 0.5 * wp.float32(level.width)
    north = (upper - lower) * 0.5 * wp.float32(level.height)
    return wp.vec3(upper + (lower - upper) * fy, east, north)


@wp.func
def height_at(scene: SceneData, level: LevelRecord, x: wp.float32, y: wp.float32) -> wp.float32:
    """Height in [0, 1] at a point of the square."""
    patch = height_patch(scene, level, x, y)
    return patch[0]


@wp.func
def above_sheet(
    scene: SceneData, relief: ReliefRecord, origin: wp.vec3, direction: wp.vec3, t: wp.float32
) -> wp.float32:
    """Height of a point of a ray above the surface, along z."""
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
    """Distance at which a ray passes through the surface, between two points on either side of it.

    Regula falsi that halves the weight of an end point that stays (the Illinois algorithm, Dowell and Jarratt 1971), so
    that it always converges.
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
def passage(relief: ReliefRecord, origin: wp.vec3, direction: wp.vec3, reach: wp.float32):
    """The segment of a ray in the box around a relief: distance to the box, entry point, and length of the segment.

    The length is negative if the ray misses the box. The entry point lies exactly on the face of the box, and distances
    are measured from it: otherwise the rounding error of a distant ray could exceed the depth of a shallow relief, and
    the ray would miss it.
    """
    # slightly larger than the surface, so that its highest and lowest parts do not lie on the faces
    lower = wp.vec3(-1.0, -1.0, -1.0001 * relief.depth)
    upper = wp.vec3(1.0, 1.0, 0.0001 * relief.depth)
    near = wp.float32(0.0)
    far = wp.float32(reach)
    entered = wp.int32(-1)
    for axis in range(3):
        if wp.abs(direction[axis]) > TINY:
            a = (lower[axis] - origin[axis]) / direction[axis]
            b = (upper[axis] - origin[axis]) / direction[axis]
            far = wp.min(far, wp.max(a, b))
            if wp.min(a, b) > near:
                near = wp.min(a, b)
                entered = axis
        elif origin[axis] < lower[axis] or origin[axis] > upper[axis]:
            far = wp.float32(-1.0)
    start = origin + near * direction
    way = wp.float32(reach - near)
    for axis in range(3):
        start[axis] = wp.clamp(start[axis], lower[axis], upper[axis])
        if entered == axis:
            start[axis] = wp.where(direction[axis] > 0.0, lower[axis], upper[axis])
        if wp.abs(direction[axis]) > TINY:
            leave = wp.where(direction[axis] > 0.0, upper[axis], lower[axis])
            way = wp.min(way, (leave - start[axis]) / direction[axis])
    if near > far:
        way = wp.float32(-1.0)
    return near, start, way


@wp.func
def relief_distance(
    scene: SceneData, record: InstanceRecord, origin: wp.vec3, direction: wp.vec3, reach: wp.float32
) -> wp.float32:
    """Distance along a unit direction to a relief in its unit space, negative for none before ``reach``.

    A ray across the whole width of the relief takes its number of steps, one across a part of it proportionally fewer,
    and a vertical ray a few.
    """
    relief = scene.reliefs[record.relief]
    near, start, way = passage(relief, origin, direction, reach)
    if way <= 0.0:
        return -1.0
    across = wp.length(wp.vec2(direction[0], direction[1])) * way
    steps = wp.max(wp.int32(wp.ceil(0.5 * across * wp.float32(relief.steps))), _FEWEST_STEPS)
    step = way / wp.float32(steps)
    t = wp.float32(0.0)
    gap = above_sheet(scene, relief, start, direction, t)
    for number in range(steps):
        next_t = wp.float32(number + 1) * step
        next_gap = above_sheet(scene, relief, start, direction, next_t)
        if (gap < 0.0) != (next_gap < 0.0):
            return near + crossing(scene, relief, start, direction, t, next_t, gap, next_gap)
        t = next_t
        gap = next_gap
    return -1.0


@wp.func
def relief_surface(scene: SceneData, record: InstanceRecord, hit: Hit, point: wp.vec3) -> LocalSurface:
    """The surface of a relief at a hit.

    The geometric normal is that of the bilinear patch. The shading normal comes from differences over one sample's
    width, so that it is continuous between patches.
    """
    relief = scene.reliefs[record.relief]
    level = scene.levels[relief.level]
    wide = 1.0 / wp.float32(level.width)
    tall = 1.0 / wp.float32(level.height)
    x = point[0]
    y = point[1]
    patch = height_patch(scene, level, x, y)
    east = patch[1] * relief.depth
    north = patch[2] * relief.depth
    local = LocalSurface()
    local.position = wp.vec3(x, y, (patch[0] - 1.0) * relief.depth)
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
    """Slope of the surface: its rise between two points on either side over their distance."""
    rise = height_at(scene, level, x + dx, y + dy) - height_at(scene, level, x - dx, y - dy)
    return rise * relief.depth * 0.5 / (dx + dy)
