"""Height fields: rays marched through the relief below a rectangle."""

from __future__ import annotations

import warp as wp

from renderer.structs import Hit, InstanceRecord, LocalSurface, SceneData


@wp.func
def relief_distance(
    scene: SceneData, record: InstanceRecord, origin: wp.vec3, direction: wp.vec3, reach: wp.float32
) -> wp.float32:
    """Distance along a unit direction to a relief in its unit space, negative for none before ``reach``."""
    return -1.0


@wp.func
def relief_surface(scene: SceneData, record: InstanceRecord, hit: Hit, point: wp.vec3) -> LocalSurface:
    """The surface of a relief at a hit."""
    local = LocalSurface()
    return local
