// The surface at the hits of sixteen rays: `surface.py` in lanes; the reasons for the steps are given there.
#pragma once
#include "functions.h"
#include "scene.h"

namespace packets {

inline f16 greatest_component(const Vec16& v) { return vmax(vmax(vabs(v.x), vabs(v.y)), vabs(v.z)); }

// A hit in the unit space of its shape.
struct LocalSurface {
    Vec16 position, geometric_normal, normal, tangent_u, tangent_v;
    f16 u, v, uv_area;
};

struct Surface {
    Vec16 position, geometric_normal, normal;
    f16 u, v, uv_density, offset;
    i16 material;
};

// A value at each of a face's corners, lane by lane.
struct Corners {
    Vec16 a, b, c;

    Vec16 weighted(f16 u, f16 v, f16 w) const { return a * u + b * v + c * w; }
};

// Stores a value that all lanes of a mask share.
template <class V> inline void put(Vec16& into, const V& value, i16 lanes) {
    into.x = lanes ? (f16)value[0] : into.x, into.y = lanes ? (f16)value[1] : into.y;
    into.z = lanes ? (f16)value[2] : into.z;
}

// Neighbouring rays hit few faces, so the data of a face is read once for all lanes that hit it.
template <class Scene, class Mesh>
inline LocalSurface mesh_surface(const Scene& scene, const Mesh& mesh, const PacketHit& hit, unsigned mask) {
    const auto* vertices = scene.vertices.data + mesh.first_vertex;
    const auto* normals = scene.normals.data + mesh.first_normal;
    const auto* uvs = scene.uvs.data + mesh.first_uv;
    const bool smooth = mesh.first_normal >= 0, mapped = mesh.first_uv >= 0;
    Corners place = {}, normal = {};
    f16 ua = 0.0f, va = 0.0f, ub = 0.0f, vb = 0.0f, uc = 0.0f, vc = 0.0f;
    each_distinct(hit.face, mask, [&](int number, unsigned same) {
        const auto& face = scene.faces.data[mesh.first_face + number];
        const int first = face[0], second = face[1], third = face[2];
        const i16 lanes = lanes_of(same);
        put(place.a, vertices[first], lanes), put(place.b, vertices[second], lanes),
            put(place.c, vertices[third], lanes);
        if (smooth)
            put(normal.a, normals[first], lanes), put(normal.b, normals[second], lanes),
                put(normal.c, normals[third], lanes);
        if (!mapped) return;
        ua = lanes ? (f16)uvs[first][0] : ua, va = lanes ? (f16)uvs[first][1] : va;
        ub = lanes ? (f16)uvs[second][0] : ub, vb = lanes ? (f16)uvs[second][1] : vb;
        uc = lanes ? (f16)uvs[third][0] : uc, vc = lanes ? (f16)uvs[third][1] : vc;
    });
    const f16 w = 1.0f - hit.u - hit.v;
    LocalSurface local;
    local.position = place.weighted(hit.u, hit.v, w);
    local.tangent_u = place.b - place.a, local.tangent_v = place.c - place.a;
    local.geometric_normal = unit(cross(local.tangent_u, local.tangent_v));
    const Vec16 between = normal.weighted(hit.u, hit.v, w);  // zero if the mesh has no normals
    local.normal = pick(dot(between, between) > SMOOTH_LEAST, between, local.geometric_normal);
    local.u = ua * hit.u + ub * hit.v + uc * w, local.v = va * hit.u + vb * hit.v + vc * w;
    local.uv_area = vabs((ub - ua) * (vc - va) - (vb - va) * (uc - ua));
    return local;
}

inline LocalSurface sphere_surface(const Vec16& point) {
    LocalSurface local;
    const Vec16 p = unit(point);
    local.position = local.geometric_normal = local.normal = p;
    const f16 turn = vatan2(p.y, p.x) * (0.5f / PI);
    local.u = turn - vfloor(turn), local.v = 1.0f - vacos(p.z) * (1.0f / PI);
    const f16 ring = vmax(vsqrt(p.x * p.x + p.y * p.y), (f16)RING_LEAST);
    local.tangent_u = {-p.y / ring, p.x / ring, (f16)0.0f};
    local.tangent_v = cross(p, local.tangent_u);
    local.uv_area = 1.0f / (2.0f * PI * PI * ring);
    return local;
}

// A face of the cube [-1, 1]³ at `side` of an axis, or the plane z = 0 (axis 2, side 1, not projected onto the face).
inline LocalSurface flat_surface(const Vec16& point, i16 axis, f16 side) {
    LocalSurface local;
    const i16 on_x = axis == 0, on_y = axis == 1;
    const f16 zero = 0.0f, two = 2.0f;
    const Vec16 x_axis = {on_x ? side : zero, on_y ? side : zero, on_x | on_y ? zero : side};
    local.position = point, local.geometric_normal = local.normal = x_axis;
    const f16 first = on_x ? point.y : on_y ? point.z : point.x, second = on_x ? point.z : on_y ? point.x : point.y;
    local.u = 0.5f * first + 0.5f, local.v = 0.5f * second + 0.5f;
    local.tangent_u = {on_x | on_y ? zero : two, on_x ? two : zero, on_y ? two : zero};
    local.tangent_v = {on_y ? two : zero, on_x | on_y ? zero : two, on_x ? two : zero};
    local.uv_area = 1.0f;
    return local;
}

template <class Scene, class Record>
inline LocalSurface local_surface(const Scene& scene, const Record& record, const PacketHit& hit, unsigned mask,
                                  Vec16 point) {
    if (record.shape == SHAPE_MESH) return mesh_surface(scene, scene.meshes.data[record.mesh], hit, mask);
    if (record.shape == SHAPE_SPHERE) return sphere_surface(point);
    if (record.shape == SHAPE_CUBE) {
        const i16 axis = hit.face % 3;
        const f16 side = hit.face < 3 ? (f16)1.0f : (f16)-1.0f;
        point = {axis == 0 ? side : point.x, axis == 1 ? side : point.y, axis == 2 ? side : point.z};
        return flat_surface(point, axis, side);
    }
    point.z = 0.0f;
    return flat_surface(point, (i16)2, (f16)1.0f);
}

// The surface of one instance at the lanes of a mask, in world space; `in_track` receives the hit point in track space,
// unless it is null.
template <class Scene, class View>
inline Surface surface_of(const Stage<Scene, View>& stage, int instance, unsigned mask, PacketHit hit,
                          const Vec16& origin, const Vec16& direction, Vec16* in_track) {
    const Scene& scene = stage.scene;
    const auto& record = scene.instances.data[instance];
    hit.face = lanes_of(mask) ? hit.face : (i16)0;  // other lanes may not hold a face of this mesh
    Vec16 point = origin + direction * hit.t;
    Pose pose;
    if (record.track) {
        pose = stage.pose(record.track);
        point = pose.to_track(point - pose.translation);
    }
    if (in_track) *in_track = pick(lanes_of(mask), point, *in_track);
    const Vec16 at = transformed(record.to_local, point) + spread(record.to_local_offset);
    const LocalSurface local = local_surface(scene, record, hit, mask, at);
    Vec16 geometric = transformed_by_transpose(record.to_local, local.geometric_normal);
    Vec16 normal = transformed_by_transpose(record.to_local, local.normal);
    Surface surface;
    surface.position = transformed(record.from_local, local.position) + spread(record.from_local_offset);
    f16 magnitude = record.extent;
    if (record.track) {
        magnitude = magnitude + greatest_component(surface.position) + greatest_component(pose.translation);
        surface.position = pose.to_world(surface.position) + pose.translation;
        geometric = pose.to_world(geometric), normal = pose.to_world(normal);
    }
    geometric = unit(geometric), normal = unit(normal);
    geometric = pick(dot(geometric, direction) > 0.0f, -geometric, geometric);
    normal = pick(dot(normal, geometric) < 0.0f, -normal, normal);
    const f16 away = dot(normal, direction);
    surface.geometric_normal = geometric;
    surface.normal = normal;
    if (bits(away > -EDGE_ON))
        surface.normal = pick(away > -EDGE_ON, unit(normal - direction * (away + EDGE_ON)), normal);
    surface.u = local.u, surface.v = local.v;
    surface.uv_density = 0.0f;
    if (bits(local.uv_area > 0.0f)) {
        const f16 patch = length(
            cross(transformed(record.from_local, local.tangent_u), transformed(record.from_local, local.tangent_v)));
        surface.uv_density = vsqrt(local.uv_area / vmax(patch, (f16)PATCH_LEAST));
    }
    surface.offset = (magnitude + greatest_component(surface.position)) * OFFSET;
    surface.material = record.material;
    if (record.material < 0)
        surface.material = gather(scene.face_materials.data + scene.meshes.data[record.mesh].first_material, hit.face);
    return surface;
}

inline void take(Surface& into, const Surface& from, unsigned mask) {
    const i16 lanes = lanes_of(mask);
    into.position = pick(lanes, from.position, into.position);
    into.geometric_normal = pick(lanes, from.geometric_normal, into.geometric_normal);
    into.normal = pick(lanes, from.normal, into.normal);
    into.u = lanes ? from.u : into.u, into.v = lanes ? from.v : into.v;
    into.uv_density = lanes ? from.uv_density : into.uv_density, into.offset = lanes ? from.offset : into.offset;
    into.material = lanes ? from.material : into.material;
}

}  // namespace packets
