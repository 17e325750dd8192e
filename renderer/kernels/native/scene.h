// Sixteen rays against the instances of a scene: `intersect.py` in lanes.
//
// Scene, view and records are Warp's structs of `structs.py`. Their generated names are unknown here, so they are
// template parameters.
#pragma once
#include "rays.h"

namespace packets {

// Calls `work(value, mask)` for every distinct value among the lanes of a mask, so that the data of an instance or a
// material is read once for all lanes that share it.
template <class Work> inline void each_distinct(i16 values, unsigned mask, Work work) {
    while (mask) {
        const int value = values[first_bit(mask)];
        const unsigned same = mask & bits(values == value);
        work(value, same);
        mask &= ~same;
    }
}

template <class V> inline Vec16 spread(const V& v) { return {(f16)v[0], (f16)v[1], (f16)v[2]}; }

template <class M> inline Vec16 transformed(const M& m, const Vec16& v) {
    return {m.data[0][0] * v.x + m.data[0][1] * v.y + m.data[0][2] * v.z,
            m.data[1][0] * v.x + m.data[1][1] * v.y + m.data[1][2] * v.z,
            m.data[2][0] * v.x + m.data[2][1] * v.y + m.data[2][2] * v.z};
}

template <class M> inline Vec16 transformed_by_transpose(const M& m, const Vec16& v) {
    return {m.data[0][0] * v.x + m.data[1][0] * v.y + m.data[2][0] * v.z,
            m.data[0][1] * v.x + m.data[1][1] * v.y + m.data[2][1] * v.z,
            m.data[0][2] * v.x + m.data[1][2] * v.y + m.data[2][2] * v.z};
}

// Idle lanes get the ray of a busy one, so that they do not widen the packet.
inline Vec16 without_idle(const Vec16& v, unsigned busy) {
    const int lane = first_bit(busy);
    const i16 keep = lanes_of(busy);
    return pick(keep, v, {(f16)v.x[lane], (f16)v.y[lane], (f16)v.z[lane]});
}

// Pose of a track at every lane's time.
struct Pose {
    Vec16 translation, axis;  // `axis` and `w` are the quaternion
    f16 w;

    Vec16 rotated(const Vec16& v, float turn) const {
        return v * (2.0f * w * w - 1.0f) + cross(axis, v) * (2.0f * turn * w) + axis * (2.0f * dot(axis, v));
    }
    // The pose of the first lane in every lane.
    Pose of_first() const {
        return {{(f16)translation.x[0], (f16)translation.y[0], (f16)translation.z[0]},
                {(f16)axis.x[0], (f16)axis.y[0], (f16)axis.z[0]},
                (f16)w[0]};
    }
    Vec16 to_world(const Vec16& v) const { return rotated(v, 1.0f); }
    Vec16 to_track(const Vec16& v) const { return rotated(v, -1.0f); }
};

// The times of sixteen samples, and the scene at these times.
template <class Scene, class View> struct Stage {
    const Scene& scene;
    const View& view;
    double time_s[LANES];
    f16 footprint_scale;  // factor of each sample's footprint

    Pose pose(int track) const {
        Pose pose;
        if (view.single_time) {
            const auto q = view.pose_rotation.data[track];
            pose.translation = spread(view.pose_translation.data[track]);
            pose.axis = {(f16)q[0], (f16)q[1], (f16)q[2]}, pose.w = q[3];
            return pose;
        }
        bool same = true;
        for (int lane = 1; lane < LANES; ++lane) same &= time_s[lane] == time_s[0];
        for (int lane = 0; lane < (same ? 1 : LANES); ++lane) pose_at(track, lane, pose);
        return same ? pose.of_first() : pose;
    }

  private:
    // Interpolates one lane with the same bits as camera.py.
    void pose_at(int track, int lane, Pose& pose) const {
#pragma clang fp contract(off)
        const auto& record = scene.tracks.data[track];
        const int last = record.key_count - 1;
        double at = (time_s[lane] - record.start_s) / record.interval_s;
        at = at < 0.0 ? 0.0 : at > last ? last : at;
        int index = (int)at;
        index = index < last - 1 ? index : last > 1 ? last - 1 : 0;
        const int first = record.first_key + index;
        const int second = index + 1 <= last ? first + 1 : record.first_key + last;
        const double fraction = at - (double)index;
        const auto &from = scene.key_translation.data[first], &to = scene.key_translation.data[second];
        pose.translation.x[lane] = (float)(from[0] + (to[0] - from[0]) * fraction);
        pose.translation.y[lane] = (float)(from[1] + (to[1] - from[1]) * fraction);
        pose.translation.z[lane] = (float)(from[2] + (to[2] - from[2]) * fraction);
        const float angle = scene.key_angle.data[first];
        float weight_b = (float)fraction, weight_a = 1.0f - weight_b;
        if (angle > SLERP_ANGLE_LEAST) {
            const float inverse = 1.0f / sinf(angle);
            weight_b = sinf(weight_b * angle) * inverse;
            weight_a = sinf(weight_a * angle) * inverse;
        }
        const auto a = scene.key_rotation.data[first], b = scene.key_rotation.data[second];
        float q[4], squared = 0.0f;
        for (int i = 0; i < 4; ++i) q[i] = a[i] * weight_a + b[i] * weight_b, squared += q[i] * q[i];
        const float scale = squared > 0.0f ? 1.0f / sqrtf(squared) : 0.0f;
        pose.axis.x[lane] = q[0] * scale, pose.axis.y[lane] = q[1] * scale, pose.axis.z[lane] = q[2] * scale;
        pose.w[lane] = q[3] * scale;
    }
};

// Distances to unit shapes along unit directions, negative for a miss; see shapes.py.
inline f16 sphere_distance(const Vec16& origin, const Vec16& direction) {
    const f16 b = dot(origin, direction);
    const Vec16 nearest = origin - direction * b;
    const f16 discriminant = 1.0f - dot(nearest, nearest);
    const f16 c = dot(origin, origin) - 1.0f;
    const f16 root = vsqrt(vmax(discriminant, (f16)0.0f));
    const f16 far = b > 0.0f ? -b - root : root - b;
    const f16 near = c / far;
    const f16 t = near >= 0.0f ? near : b > 0.0f ? (f16)-1.0f : far;
    return discriminant < 0.0f ? (f16)-1.0f : t;
}

inline f16 plane_distance(const Vec16& origin, const Vec16& direction, bool disk) {
    const f16 t = -origin.z / direction.z;
    const f16 x = origin.x + t * direction.x, y = origin.y + t * direction.y;
    const i16 inside = disk ? x * x + y * y <= 1.0f : (vabs(x) <= 1.0f) & (vabs(y) <= 1.0f);
    return (direction.z != 0.0f) & inside ? t : (f16)-1.0f;
}

inline f16 cube_distance(const Vec16& origin, const Vec16& direction, i16& face) {
    f16 near = -FAR, far = FAR;
    i16 near_face = 0, far_face = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const f16 inverse = reciprocal(direction[axis]);
        const f16 a = (-1.0f - origin[axis]) * inverse, b = (1.0f - origin[axis]) * inverse;
        const f16 enter = vmin(a, b), leave = vmax(a, b);
        near_face = enter > near ? (inverse > 0.0f ? (i16)(axis + 3) : (i16)axis) : near_face;
        far_face = leave < far ? (inverse > 0.0f ? (i16)axis : (i16)(axis + 3)) : far_face;
        near = vmax(near, enter), far = vmin(far, leave);
    }
    face = near >= 0.0f ? near_face : far_face;
    const i16 missed = (near > far) | (far < 0.0f);
    return missed ? (f16)-1.0f : near >= 0.0f ? near : far;
}

struct Hit {
    PacketHit at;
    i16 instance;  // negative for a miss
};

// Lanes of `busy` that hit an instance nearer than `hit.t`; the hits are stored in `hit`. Rays are in track space.
template <bool any, class Scene, class Record>
inline unsigned meet_instance(const Scene& scene, const Record& record, const Vec16& origin, const Vec16& direction,
                              unsigned busy, PacketHit& hit) {
    const Vec16 start = transformed(record.to_local, origin) + spread(record.to_local_offset);
    const Vec16 towards = transformed(record.to_local, direction);
    if (record.shape == SHAPE_MESH) {
        const auto& mesh = scene.meshes.data[record.mesh];
        const Tree tree((const Node*)scene.tree_nodes.data + mesh.first_node,
                        (const Block*)scene.tree_blocks.data + mesh.first_block, mesh.face_count);
        PacketHit local = hit;
        local.face = -1;
        local.t = lanes_of(busy) ? hit.t : (f16)-1.0f;
        const unsigned found = trace<any>(tree, start, towards, local);
        const i16 better = lanes_of(found);
        hit.t = better ? local.t : hit.t, hit.u = better ? local.u : hit.u, hit.v = better ? local.v : hit.v;
        hit.face = better ? local.face : hit.face;
        return found;
    }
    const f16 stretch = length(towards);
    const Vec16 along = towards * (1.0f / stretch);
    i16 face = 0;
    f16 t;
    if (record.shape == SHAPE_SPHERE)
        t = sphere_distance(start, along);
    else if (record.shape == SHAPE_CUBE)
        t = cube_distance(start, along, face);
    else
        t = plane_distance(start, along, record.shape == SHAPE_DISK);
    const i16 better = (t >= 0.0f) & (t < hit.t * stretch) & lanes_of(busy);
    hit.t = better ? t / stretch : hit.t;
    hit.face = better ? face : hit.face;
    return bits(better);
}

// Lanes that stay outside a sphere about the origin up to `reach`; rays start at `from`.
inline unsigned missing_sphere(const Vec16& from, const Vec16& direction, float radius, const f16& reach) {
    const f16 b = dot(from, direction), squared = dot(from, from);
    const Vec16 nearest = from - direction * b;
    const float limit = radius * radius;
    // The slack covers the rounding error of a distant origin.
    const i16 past = (b > 0.0f) | (-b - radius > reach) | (dot(nearest, nearest) > limit + SPHERE_SLACK * squared);
    return bits((squared > limit) & past);
}

template <class Record>
inline unsigned meeting_box(const Vec16& origin, const Vec16& inverse, const Record& node, const f16& reach) {
    f16 near = 0.0f, far = reach;
    for (int axis = 0; axis < 3; ++axis) {
        const f16 a = (node.lower[axis] - origin[axis]) * inverse[axis];
        const f16 b = (node.upper[axis] - origin[axis]) * inverse[axis];
        near = vmax(near, vmin(a, b)), far = vmin(far, vmax(a, b));
    }
    return bits(near <= far);
}

// Traces world rays of unit direction through the scene. Lanes of `busy` reach up to `hit.at.t`. With `any`, a lane
// ends at its first hit. Returns the lanes that found a hit; the nearest is in `hit`.
template <bool any, class Scene, class View>
inline unsigned meet_scene(const Stage<Scene, View>& stage, const Vec16& origin, const Vec16& direction, unsigned busy,
                           Hit& hit) {
    const Scene& scene = stage.scene;
    const Vec16 world_start = without_idle(origin, busy), world_towards = without_idle(direction, busy);
    unsigned found = 0;
    for (int g = 0; g < scene.group_count; ++g) {
        const auto& group = scene.groups.data[g];
        Vec16 start = world_start, towards = world_towards;
        unsigned here = busy;
        if (group.track) {
            const Pose pose = stage.pose(group.track);
            start = start - pose.translation;
            here &= ~missing_sphere(start, towards, group.radius, hit.at.t);
            if (!here) continue;
            start = pose.to_track(start), towards = pose.to_track(towards);
        }
        const Vec16 inverse = {reciprocal(towards.x), reciprocal(towards.y), reciprocal(towards.z)};
        for (int index = group.first; index < group.end;) {
            const auto& node = scene.nodes.data[index];
            const unsigned meeting = here & meeting_box(start, inverse, node, hit.at.t);
            index = meeting ? index + 1 : node.skip;
            if (!meeting || node.instance < 0) continue;
            const auto& record = scene.instances.data[node.instance];
            const unsigned better = meet_instance<any>(scene, record, without_idle(start, meeting),
                                                       without_idle(towards, meeting), meeting, hit.at);
            hit.instance = lanes_of(better) ? (i16)node.instance : hit.instance;
            found |= better;
            if (any) {
                busy &= ~better, here &= ~better;
                if (!busy) return found;
                if (!here) break;
            }
        }
    }
    return found;
}

}  // namespace packets
