"""Texture lookup: constants, images with mip maps, checkerboards."""

from __future__ import annotations

import warp as wp

from renderer.layout.features import Feature
from renderer.layout.kinds import Filter, TextureKind, Wrap
from renderer.layout.sizes import TEXELS_MOST, UV_LEAST, UV_MOST
from renderer.layout.structs import LevelRecord, SceneData, TextureRecord


@wp.func
def wrapped(index: wp.int32, count: wp.int32, wrap: wp.int32) -> wp.int32:
    """Texel index in ``0..count - 1``, or negative where the texture is black."""
    if index >= 0 and index < count:
        return index
    if wrap == Wrap.REPEAT:
        rest = index % count
        if rest < 0:
            rest = rest + count
        return rest
    if wrap == Wrap.BLACK:
        return -1
    return wp.clamp(index, 0, count - 1)


@wp.func
def texel(scene: SceneData, level: LevelRecord, x: wp.int32, y: wp.int32) -> wp.vec3:
    """Texel at wrapped indices."""
    if x < 0 or y < 0:
        return wp.vec3(0.0, 0.0, 0.0)
    return scene.texels[level.first_texel + y * level.width + x]


@wp.func
def bilinear(
    scene: SceneData, level: LevelRecord, x: wp.float32, y: wp.float32, wrap_x: wp.int32, wrap_y: wp.int32
) -> wp.vec3:
    """Bilinear lookup at ``x``, ``y``, texels from the top left corner of the image."""
    left = wp.floor(x - 0.5)
    top = wp.floor(y - 0.5)
    fx = x - 0.5 - left
    fy = y - 0.5 - top
    x0 = wrapped(wp.int32(left), level.width, wrap_x)
    x1 = wrapped(wp.int32(left) + 1, level.width, wrap_x)
    y0 = wrapped(wp.int32(top), level.height, wrap_y)
    y1 = wrapped(wp.int32(top) + 1, level.height, wrap_y)
    upper = texel(scene, level, x0, y0) * (1.0 - fx) + texel(scene, level, x1, y0) * fx
    lower = texel(scene, level, x0, y1) * (1.0 - fx) + texel(scene, level, x1, y1) * fx
    return upper * (1.0 - fy) + lower * fy


@wp.func
def image_bilinear_wrapped_around(scene: SceneData, index: wp.int32, u: wp.float32, v: wp.float32) -> wp.vec3:
    """Bilinear lookup in a latitude–longitude image, with ``u`` in turns and ``v`` from the top row."""
    level = scene.levels[index]
    x = (u - wp.floor(u)) * wp.float32(level.width)
    y = v * wp.float32(level.height)
    return bilinear(scene, level, x, y, Wrap.REPEAT, Wrap.CLAMP)


@wp.func
def level_lookup(scene: SceneData, record: TextureRecord, index: wp.int32, u: wp.float32, v: wp.float32) -> wp.vec3:
    """Bilinear lookup in one level of an image."""
    level = scene.levels[record.first_level + index]
    x = u * wp.float32(level.width)
    y = (1.0 - v) * wp.float32(level.height)
    return bilinear(scene, level, x, y, record.wrap, record.wrap)


@wp.func
def image_lookup(scene: SceneData, record: TextureRecord, uv: wp.vec2, footprint_uv: wp.float32) -> wp.vec3:
    """Colour of an image texture at ``uv``; ``footprint_uv`` is the width of the ray's cone in units of uv.

    Levels of a mip map are blended: otherwise a visible line where the level changes would move over the ground with
    the camera.
    """
    u = uv[0] * record.uv_scale[0] + record.uv_offset[0]
    v = uv[1] * record.uv_scale[1] + record.uv_offset[1]
    if record.wrap == Wrap.REPEAT:
        # before scaling to texels, so that distant repetitions keep their precision
        u = u - wp.floor(u)
        v = v - wp.floor(v)
    else:
        u = wp.clamp(u, UV_LEAST, UV_MOST)
        v = wp.clamp(v, UV_LEAST, UV_MOST)
    if record.filter == Filter.NEAREST:
        level = scene.levels[record.first_level]
        column = wrapped(wp.int32(wp.floor(u * wp.float32(level.width))), level.width, record.wrap)
        row = wrapped(wp.int32(wp.floor((1.0 - v) * wp.float32(level.height))), level.height, record.wrap)
        return texel(scene, level, column, row)
    detail = wp.float32(0.0)
    if record.filter == Filter.MIPMAP:
        detail = wp.log2(wp.clamp(footprint_uv * record.texel_scale, 1.0, TEXELS_MOST))
        detail = wp.min(detail, wp.float32(record.level_count - 1))
    first = wp.int32(detail)
    blend = detail - wp.float32(first)
    color = level_lookup(scene, record, first, u, v)
    if blend > 0.0:
        color = color * (1.0 - blend) + level_lookup(scene, record, first + 1, u, v) * blend
    return color


@wp.func
def texture_color(
    features: wp.int32, scene: SceneData, texture: wp.int32, uv: wp.vec2, footprint_uv: wp.float32
) -> wp.vec3:
    """Colour of a texture; follows checkerboards down to a constant or an image."""
    record = scene.textures[texture]
    tint = record.value
    while (features & Feature.CHECKERBOARD) != 0 and record.kind == TextureKind.CHECKERBOARD:
        square = wp.floor(uv[0] * record.uv_scale[0]) + wp.floor(uv[1] * record.uv_scale[1])
        if square - 2.0 * wp.floor(square * 0.5) == 0.0:
            record = scene.textures[record.even]
        else:
            record = scene.textures[record.odd]
        tint = wp.cw_mul(tint, record.value)
    if (features & Feature.IMAGE) != 0 and record.kind != TextureKind.CONSTANT:
        tint = wp.cw_mul(tint, image_lookup(scene, record, uv, footprint_uv))
    return tint
