// Reading a group's primitives from the scene: the door where what cannot be traced is left out, and counted by cause.
#pragma once
#include <cstring>
#include <vector>

#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/group.h"

namespace luch::cpu {

inline constexpr size_t GATHER_CHUNK = 16384;  // primitives

struct Corners3 {
    Vec3 p[3];
};

// Reads primitives by ref, in the group's space.
class Gather {
 public:
    Gather(const Group& group, const SceneView& scene, const std::vector<std::vector<u8>>& flags)
        : group_(group), scene_(scene), flags_(flags) {}

    u32 ref_count() const {
        const Member& last = group_.members.back();
        return last.first_ref + last.prim_count;
    }
    // False for a triangle that cannot be traced: an index outside the mesh, a vertex that is not finite, no area.
    bool read(u32 ref, const Member& member, Corners3* out) const {
        const MeshView& mesh = scene_.meshes[member.mesh];
        const u32* indices = scene_.triangles + 3 * (size_t(mesh.first_triangle) + member.prim_of(ref));
        for (int k = 0; k < 3; ++k) {
            if (indices[k] >= mesh.vertex_count) return false;
            const float* p = scene_.positions + 3 * (size_t(mesh.first_vertex) + indices[k]);
            Vec3 point = {p[0], p[1], p[2]};
            if (member.instance != NONE) point = transform_point(scene_.instances[member.instance].to_world, point);
            out->p[k] = point;
        }
        return triangle_can_be_traced(out->p[0], out->p[1], out->p[2]);
    }
    // False for a sphere that is not finite or has no size.
    bool read(u32 ref, const Member& member, Sphere* out) const {
        const float* s = sphere_at(scene_, scene_.meshes[member.mesh], member.prim_of(ref));
        *out = {{s[0], s[1], s[2]}, s[3]};
        return sphere_can_be_traced(*out);
    }
    bool read_box(u32 ref, const Member& member, Box* out) const {
        if (group_.kind == GroupKind::CURVES) {
            if (!piece_can_be_traced(group_.curves, ref)) return false;
            *out = capsule_box(piece_capsule(group_.curves, ref));
            return true;
        }
        if (group_.kind == GroupKind::SPHERES) {
            Sphere s;
            if (!read(ref, member, &s)) return false;
            *out = sphere_box(s.center, s.radius);
            return true;
        }
        Corners3 c;
        if (!read(ref, member, &c)) return false;
        *out = triangle_box(c.p[0], c.p[1], c.p[2]);
        return true;
    }
    // Why a primitive that cannot be read cannot.
    LeftOutCause cause(u32 ref, const Member& member) const;
    // The same to every ray, and as transparent.
    bool same(u32 a, u32 b, const Group& group) const {
        const Member &of_a = group.member_of(a), &of_b = group.member_of(b);
        if ((flagged(a, of_a) == a) != (flagged(b, of_b) == b)) return false;
        if (group.kind == GroupKind::CURVES) return false;  // nobody copies hair
        if (group.kind == GroupKind::SPHERES) {
            Sphere s, t;
            return read(a, of_a, &s) && read(b, of_b, &t) && std::memcmp(&s, &t, sizeof(s)) == 0;
        }
        Corners3 c, d;
        return read(a, of_a, &c) && read(b, of_b, &d) && std::memcmp(&c, &d, sizeof(c)) == 0;
    }
    bool has_flags() const { return !flags_.empty(); }
    u32 flagged(u32 ref, const Member& member) const {
        if (flags_.empty() || flags_[member.mesh].empty()) return ref;
        u8 flag = flags_[member.mesh][member.prim_of(ref)];
        return flag & PRIMITIVE_MAY_BE_TRANSPARENT ? ref | REF_TRANSPARENT : ref;
    }

 private:
    const Group& group_;
    const SceneView& scene_;
    const std::vector<std::vector<u8>>& flags_;
};

// The boxes of the primitives kept, in order of ref; *kept: how many. Fills group.duplicates and group.left_out. A copy
// of a primitive can win no tie against the first of them, so it is left out too: no tree could part a thousand of them,
// and each ray would test them all.
HugeArray<PrimBox> gather_boxes(Group& group, const Gather& gather, ThreadPool& pool, size_t* kept);

}  // namespace luch::cpu
