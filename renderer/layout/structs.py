"""The memory layout of the records that kernels read.

``buffers.py`` fills those of the scene once; ``trace.py`` fills :class:`ViewData` for every batch.
"""

from __future__ import annotations

import warp as wp

from renderer.layout.scattering import ScatterRecord


@wp.struct
class TrackRecord:
    """A rigid motion: the range of its keys in the key arrays, and their times in seconds."""

    first_key: wp.int32
    key_count: wp.int32
    start_s: wp.float64
    interval_s: wp.float64


@wp.struct
class InstanceRecord:
    """An instance: a shape with its placement.

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
    extent: wp.float32  # greatest half size of the placed shape, scene units
    emission: wp.vec3  # radiance emitted on the outside
    relief: wp.int32  # index of a height field


@wp.struct
class MeshRecord:
    """A mesh: its tree, and its arrays in the pools. A negative first index means that an array is missing.

    CPU kernels traverse the structure that starts at ``first_node`` and ``first_block``; other devices use Warp's tree
    with the number ``id``.
    """

    id: wp.uint64
    first_node: wp.int32
    first_block: wp.int32
    first_face: wp.int32
    face_count: wp.int32
    first_vertex: wp.int32
    first_normal: wp.int32
    first_uv: wp.int32
    first_material: wp.int32  # of the materials of its faces; without them, the instance's material holds


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
    transmission: wp.int32  # colour that glass transmits
    ior: wp.float32
    thin: wp.int32
    cos_spread: wp.float32  # cosine of the half angle of the cone of reflected and refracted rays
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
    """One node of a texture; ``value`` multiplies its result."""

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
    direction towards a directional light. ``color`` is an intensity, irradiance or radiance.
    """

    kind: wp.int32
    place: wp.vec3
    color: wp.vec3
    track: wp.int32  # motion of a rectangle or sphere
    across: wp.vec3  # half edges of a rectangle; for a spot, ``across`` is its direction
    along: wp.vec3
    radius: wp.float32  # of a sphere
    cos_inner: wp.float32  # cosine of the half angle of a sun's disc, or of a spot's inner cone
    cos_outer: wp.float32  # cosine of a spot's outer cone


@wp.struct
class NodeRecord:
    """A box around instances of one track, in its track space; its descendants lie between it and ``skip``."""

    lower: wp.vec3
    upper: wp.vec3
    skip: wp.int32
    instance: wp.int32  # instance of a leaf; negative for inner nodes


@wp.struct
class GroupRecord:
    """The instances on one track as a range of nodes, in a sphere about the track's origin."""

    track: wp.int32
    first: wp.int32
    end: wp.int32
    radius: wp.float32


@wp.struct
class SceneData:
    """The scene in the form that kernels read."""

    group_count: wp.int32
    groups: wp.array(dtype=GroupRecord)
    nodes: wp.array(dtype=NodeRecord)
    instances: wp.array(dtype=InstanceRecord)
    meshes: wp.array(dtype=MeshRecord)
    tree_nodes: wp.array(dtype=wp.float32)  # records of native/tree.h
    tree_blocks: wp.array(dtype=wp.float32)
    kd_nodes: wp.array(dtype=wp.float32)  # records of native/structures.h
    structure: wp.int32  # kind of structure over the triangles of meshes, see accelerators.py
    vertices: wp.array(dtype=wp.vec3)
    faces: wp.array(dtype=wp.vec3i)
    normals: wp.array(dtype=wp.vec3)
    uvs: wp.array(dtype=wp.vec2)
    face_materials: wp.array(dtype=wp.int32)
    materials: wp.array(dtype=MaterialRecord)
    scattering: wp.array(dtype=ScatterRecord)  # one per material for paths, else a single one
    light_of_instance: wp.array(dtype=wp.int32)  # light of each instance; negative for none
    textures: wp.array(dtype=TextureRecord)
    levels: wp.array(dtype=LevelRecord)
    texels: wp.array(dtype=wp.vec3)
    reliefs: wp.array(dtype=ReliefRecord)
    light_count: wp.int32
    lights: wp.array(dtype=LightRecord)
    tracks: wp.array(dtype=TrackRecord)
    key_translation: wp.array(dtype=wp.vec3d)
    key_rotation: wp.array(dtype=wp.quat)
    key_angle: wp.array(dtype=wp.float32)  # angle between a key's quaternion and the next, radians
    ambient: wp.vec3
    environment_level: wp.int32  # of the background at infinity; negative for black
    environment_to_map: wp.mat33
    environment_scale: wp.float32
    lighting_level: wp.int32  # of the environment that lights surfaces
    lighting_to_map: wp.mat33
    lighting_scale: wp.float32
    lighting_rows: wp.array(dtype=wp.float32)  # cumulative probabilities of its rows, 0 to 1
    lighting_columns: wp.array2d(dtype=wp.float32)  # those of the texels within each row
    depth: wp.int32
    throughput_cutoff: wp.float32
    light_cells: wp.int32
    reflection_rays: wp.int32
    refraction_rays: wp.int32
    seed: wp.uint32


@wp.struct
class ViewData:
    """The camera, and the poses of a launch whose samples share one time."""

    kind: wp.int32
    from_camera: wp.mat33
    from_camera_offset: wp.vec3
    camera_track: wp.int32
    tan_x: wp.float32  # tangents of the image's half angles; its half size where rays are parallel
    tan_y: wp.float32
    width: wp.float32  # of a pixel's cone at the camera; ``spread`` is its growth per unit of distance
    spread: wp.float32
    lens_radius: wp.float32
    focal_distance: wp.float32
    single_time: wp.int32  # 1 where ``pose_*`` hold every track's pose for all samples of the launch
    pose_translation: wp.array(dtype=wp.vec3)
    pose_rotation: wp.array(dtype=wp.quat)
    work: wp.array(dtype=wp.int64)  # counts of node visits and triangle tests; empty if not requested


@wp.struct
class Hit:
    """Nearest intersection along a ray; ``instance`` is negative for a miss.

    ``u`` and ``v`` are the weights of the first two corners of a mesh's face; other shapes do not use them.
    """

    instance: wp.int32
    t: wp.float32
    u: wp.float32
    v: wp.float32
    face: wp.int32


@wp.struct
class LocalSurface:
    """A hit in the unit space of its shape; the patch of both tangents has the area ``uv_area`` in uv."""

    position: wp.vec3
    geometric_normal: wp.vec3
    normal: wp.vec3
    uv: wp.vec2
    tangent_u: wp.vec3
    tangent_v: wp.vec3
    uv_area: wp.float32


@wp.struct
class Surface:
    """A hit in world space, for shading; normals are on the viewer's side."""

    position: wp.vec3
    geometric_normal: wp.vec3
    normal: wp.vec3
    uv: wp.vec2
    uv_density: wp.float32  # uv units per scene unit, geometric mean of both axes
    offset: wp.float32  # offset of secondary rays from the surface against rounding errors, scene units
    material: wp.int32
    emission: wp.vec3
    in_track: wp.vec3  # hit point in the space of the track
    inside: wp.bool  # whether the viewer is on the side that the normal of the shape points away from


@wp.struct
class FirstHit:
    """The first hit of a camera ray: the instance, and the point in the space of its track.

    For a miss ``instance`` is negative, and ``point`` is the direction of the ray in world space. ``occluder`` is the
    instance that hides the first light, ``LIT`` for none, ``UNLIT`` without a shadow ray.
    """

    instance: wp.int32
    point: wp.vec3
    occluder: wp.int32


@wp.struct
class Draw:
    """State of a sample's random numbers: the key of its group, and its index in the group."""

    key: wp.uint32
    index: wp.int32
    count: wp.int32


@wp.struct
class Ray:
    """A ray to be traced; ``weight`` multiplies its radiance, ``travelled`` is the length of the path before it."""

    start: wp.vec3
    towards: wp.vec3
    weight: wp.vec3
    travelled: wp.float32
    bounces: wp.int32
    draw: Draw
