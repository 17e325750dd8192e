"""Records that kernels read, as they lie in memory.

``buffers.py`` fills those of the scene once; ``trace.py`` fills :class:`ViewData` for every batch.
"""

from __future__ import annotations

import warp as wp

from renderer.layout.scattering import ScatterRecord


@wp.struct
class TrackRecord:
    """A rigid motion: where its keys lie in the key arrays, and their times in seconds."""

    first_key: wp.int32
    key_count: wp.int32
    start_s: wp.float64
    interval_s: wp.float64


@wp.struct
class InstanceRecord:
    """A shape in place.

    ``to_local`` maps track space (the space the rigid track acts on; world space for a static instance) to the unit
    space of the shape, ``from_local`` back. Meshes are stored centred and scaled into ``[-1, 1]³``, spheres and disks
    with radius 1, so that float32 serves scenes of any size.
    """

    shape: wp.int32
    track: wp.int32
    material: wp.int32
    mesh: wp.int32
    to_local: wp.mat33
    to_local_offset: wp.vec3
    from_local: wp.mat33
    from_local_offset: wp.vec3
    extent: wp.float32  # greatest distance the unit shape is stretched to, scene units
    emission: wp.vec3  # radiance that leaves the outside
    relief: wp.int32  # of a height field


@wp.struct
class MeshRecord:
    """A mesh: its tree, and where its arrays lie in the pools. A negative first index means it has none.

    The CPU's kernels walk the structure that starts at ``first_node`` and ``first_block``; elsewhere Warp's own tree is
    known by ``id``.
    """

    id: wp.uint64
    first_node: wp.int32
    first_block: wp.int32
    first_face: wp.int32
    face_count: wp.int32
    first_vertex: wp.int32
    first_normal: wp.int32
    first_uv: wp.int32
    first_material: wp.int32  # of its faces' materials; where it has none, instances decide


@wp.struct
class ReliefRecord:
    """A height field below the square [-1, 1]² at z = 0; its samples lie in the pool of texels."""

    level: wp.int32
    depth: wp.float32
    steps: wp.int32


@wp.struct
class MaterialRecord:
    """Every supported material in one form; a negative texture means none."""

    diffuse: wp.int32
    mirror: wp.int32
    transmission: wp.int32  # of glass
    ior: wp.float32
    thin: wp.int32
    cos_spread: wp.float32  # of the half angle that reflected and refracted rays are spread by
    specular: wp.vec3
    exponent: wp.float32
    ambient: wp.float32
    fresnel_min: wp.float32
    fresnel_max: wp.float32
    fresnel_exponent: wp.float32
    mirror_tint: wp.vec3
    emission: wp.vec3


@wp.struct
class TextureRecord:
    """One node of a texture; ``value`` multiplies whatever the node yields."""

    kind: wp.int32
    value: wp.vec3
    uv_scale: wp.vec2
    uv_offset: wp.vec2
    texel_scale: wp.float32  # texels per unit of uv, geometric mean of both axes
    first_level: wp.int32
    level_count: wp.int32
    wrap: wp.int32
    filter: wp.int32
    even: wp.int32
    odd: wp.int32


@wp.struct
class LevelRecord:
    """One level of a mip map in the pool of texels."""

    first_texel: wp.int32
    width: wp.int32
    height: wp.int32


@wp.struct
class LightRecord:
    """A light.

    ``place`` is a position (point, spot; centre of a sphere or rectangle, in the space of ``track``), or the unit
    direction towards a directional light. ``color`` is an intensity, an irradiance or a radiance, as the light has it.
    """

    kind: wp.int32
    place: wp.vec3
    color: wp.vec3
    track: wp.int32  # of a rectangle or sphere
    across: wp.vec3  # half edges of a rectangle; of a spot, across is the direction it shines in
    along: wp.vec3
    radius: wp.float32  # of a sphere
    cos_inner: wp.float32  # of the half angle of a sun's disc, or where a spot begins to fall off
    cos_outer: wp.float32  # where a spot ends


@wp.struct
class NodeRecord:
    """A box over instances of one track, in its track space; nodes below it lie between it and ``skip``."""

    lower: wp.vec3
    upper: wp.vec3
    skip: wp.int32
    instance: wp.int32  # of a leaf, else negative


@wp.struct
class GroupRecord:
    """The instances on one track as a run of nodes, and the sphere about the track's origin that holds them all."""

    track: wp.int32
    first: wp.int32
    end: wp.int32
    radius: wp.float32


@wp.struct
class SceneData:
    """The scene as kernels see it."""

    group_count: wp.int32
    groups: wp.array(dtype=GroupRecord)
    nodes: wp.array(dtype=NodeRecord)
    instances: wp.array(dtype=InstanceRecord)
    meshes: wp.array(dtype=MeshRecord)
    tree_nodes: wp.array(dtype=wp.float32)  # records of native/tree.h
    tree_blocks: wp.array(dtype=wp.float32)
    kd_nodes: wp.array(dtype=wp.float32)  # records of native/structures.h
    structure: wp.int32  # over the triangles of meshes, see accelerators.py
    vertices: wp.array(dtype=wp.vec3)
    faces: wp.array(dtype=wp.vec3i)
    normals: wp.array(dtype=wp.vec3)
    uvs: wp.array(dtype=wp.vec2)
    face_materials: wp.array(dtype=wp.int32)
    materials: wp.array(dtype=MaterialRecord)
    scattering: wp.array(dtype=ScatterRecord)  # one a material, for paths; else one alone
    light_of_instance: wp.array(dtype=wp.int32)  # the light that an instance is; negative for none
    textures: wp.array(dtype=TextureRecord)
    levels: wp.array(dtype=LevelRecord)
    texels: wp.array(dtype=wp.vec3)
    reliefs: wp.array(dtype=ReliefRecord)
    light_count: wp.int32
    lights: wp.array(dtype=LightRecord)
    tracks: wp.array(dtype=TrackRecord)
    key_translation: wp.array(dtype=wp.vec3d)
    key_rotation: wp.array(dtype=wp.quat)
    key_angle: wp.array(dtype=wp.float32)  # between a key's quaternion and the next one's, radians
    ambient: wp.vec3
    environment_level: wp.int32  # of what is seen at infinity; negative for black
    environment_to_map: wp.mat33
    environment_scale: wp.float32
    lighting_level: wp.int32  # of the environment that lights surfaces
    lighting_to_map: wp.mat33
    lighting_scale: wp.float32
    lighting_rows: wp.array(dtype=wp.float32)  # chances of its rows, summed up: from 0 to 1
    lighting_columns: wp.array2d(dtype=wp.float32)  # the same of the texels within each row
    depth: wp.int32
    throughput_cutoff: wp.float32
    light_cells: wp.int32
    reflection_rays: wp.int32
    refraction_rays: wp.int32
    seed: wp.uint32


@wp.struct
class ViewData:
    """The camera, and what is known about the time of a whole launch."""

    kind: wp.int32
    from_camera: wp.mat33
    from_camera_offset: wp.vec3
    camera_track: wp.int32
    tan_x: wp.float32  # tangents of the half angles of the image; its half size where rays are parallel
    tan_y: wp.float32
    width: wp.float32  # of a pixel's cone at the camera, and per unit of distance
    spread: wp.float32
    lens_radius: wp.float32
    focal_distance: wp.float32
    single_time: wp.int32  # 1 where ``pose_*`` hold every track's pose for all samples of the launch
    pose_translation: wp.array(dtype=wp.vec3)
    pose_rotation: wp.array(dtype=wp.quat)
    work: wp.array(dtype=wp.int64)  # sums node visits and triangle tests; empty where they are not asked for


@wp.struct
class Hit:
    """Nearest intersection along a ray; ``instance`` is negative for a miss.

    ``u`` and ``v`` weigh the first two corners of a mesh's face; for other shapes they are unused.
    """

    instance: wp.int32
    t: wp.float32
    u: wp.float32
    v: wp.float32
    face: wp.int32


@wp.struct
class LocalSurface:
    """A hit in the unit space of its shape; the area of a patch ``tangent_u x tangent_v`` covers ``uv_area`` of uv."""

    position: wp.vec3
    geometric_normal: wp.vec3
    normal: wp.vec3
    uv: wp.vec2
    tangent_u: wp.vec3
    tangent_v: wp.vec3
    uv_area: wp.float32


@wp.struct
class Surface:
    """What shading needs of a hit, in world space; normals are on the viewer's side."""

    position: wp.vec3
    geometric_normal: wp.vec3
    normal: wp.vec3
    uv: wp.vec2
    uv_density: wp.float32  # uv units per scene unit, geometric mean of both axes
    offset: wp.float32  # how far a ray must start off the surface to clear rounding, scene units
    material: wp.int32
    emission: wp.vec3
    in_track: wp.vec3  # the point of the ray, in the space of the track
    inside: wp.bool  # whether the viewer is on the side that the normal of the shape points away from


@wp.struct
class FirstHit:
    """What a camera ray meets first: the instance, and the point in the space of its track.

    For a miss ``instance`` is negative, and ``point`` the direction of the ray in world space. ``occluder`` is the
    instance in the way of the first light, ``LIT`` for none, ``UNLIT`` where the light is not asked.
    """

    instance: wp.int32
    point: wp.vec3
    occluder: wp.int32


@wp.struct
class Draw:
    """Which sample's random numbers: a group's key, and the place of the sample in it."""

    key: wp.uint32
    index: wp.int32
    count: wp.int32


@wp.struct
class Ray:
    """A ray under way; ``weight`` is what its radiance counts for, ``travelled`` the way behind it."""

    start: wp.vec3
    towards: wp.vec3
    weight: wp.vec3
    travelled: wp.float32
    bounces: wp.int32
    draw: Draw
