#include "cpu/accel/gather.h"

#include <algorithm>
#include <mutex>

#include "cpu/accel/copies.h"

namespace luch::cpu {
namespace {

u32 hash_of(const PrimBox& box) { return hash_of_floats(box.hi, 3, hash_of_floats(box.minus_lo, 3)); }

// Counts what is left out, by mesh: by each thread for itself, then together.
class LeftOutCounter {
 public:
    void add(const Member& member, LeftOutCause cause) {
        if (rows_.empty() || rows_.back().mesh != member.mesh) rows_.push_back({member.mesh});
        LeftOut& row = rows_.back();
        ++(cause == LeftOutCause::INVALID   ? row.invalid
           : cause == LeftOutCause::TOO_FAR ? row.too_far
           : cause == LeftOutCause::EMPTY   ? row.empty
                                            : row.copies);
    }
    void add_to(Group& group, std::mutex& mutex) const {
        if (rows_.empty()) return;
        std::lock_guard<std::mutex> lock(mutex);
        for (const LeftOut& row : rows_) {
            add_left_out(row, &group.left_out);
            group.duplicates += row.copies;
        }
    }

 private:
    std::vector<LeftOut> rows_;
};

// From chunk to chunk; returns how many are left.
size_t search_all(PrimBox* boxes, size_t count, const Gather& gather, Group& group) {
    LeftOutCounter counter;
    size_t kept = leave_out_copies(
        boxes, count, hash_of, [&](const PrimBox& a, const PrimBox& b) { return gather.same(a.id, b.id, group); },
        [&](const PrimBox& box) { counter.add(group.member_of(box.id), LeftOutCause::COPY); });
    std::mutex mutex;
    counter.add_to(group, mutex);
    return kept;
}

}  // namespace

LeftOutCause Gather::cause(u32 ref, const Member& member) const {
    if (group_.kind == GroupKind::CURVES) return LeftOutCause::INVALID;
    if (group_.kind == GroupKind::SPHERES) {
        Sphere s;
        read(ref, member, &s);
        if (!finite_v(s.center) || !finite_f(s.radius)) return LeftOutCause::INVALID;
        return s.radius == 0.0f ? LeftOutCause::EMPTY : LeftOutCause::TOO_FAR;
    }
    const MeshView& mesh = scene_.meshes[member.mesh];
    const u32* indices = scene_.triangles + 3 * (size_t(mesh.first_triangle) + member.prim_of(ref));
    for (int k = 0; k < 3; ++k) {
        if (indices[k] >= mesh.vertex_count) return LeftOutCause::INVALID;
        if (!finite_v(vertex_at(scene_, mesh, indices[k]))) return LeftOutCause::INVALID;
    }
    Corners3 c;
    read(ref, member, &c);
    for (const Vec3& p : c.p)
        if (!point_can_be_traced(p)) return LeftOutCause::TOO_FAR;
    return LeftOutCause::EMPTY;
}

HugeArray<PrimBox> gather_boxes(Group& group, const Gather& gather, ThreadPool& pool, size_t* kept) {
    size_t refs = gather.ref_count();
    HugeArray<PrimBox> boxes(refs);
    std::vector<size_t> filled((refs + GATHER_CHUNK - 1) / GATHER_CHUNK);
    std::mutex mutex;
    pool.parallel_for(refs, GATHER_CHUNK, [&](size_t begin, size_t end, unsigned) {
        size_t next = begin;
        LeftOutCounter counter;
        CopySearch search;
        auto same = [&](u32 a, u32 b) { return gather.same(a, b, group); };
        const Member* member = &group.member_of(u32(begin));
        const Member* last = &group.members.back();
        for (size_t ref = begin; ref < end; ++ref) {
            while (member != last && ref >= member[1].first_ref) ++member;
            Box b;
            if (!gather.read_box(u32(ref), *member, &b)) {
                counter.add(*member, gather.cause(u32(ref), *member));
                continue;
            }
            boxes[next] = {{-b.lo.x, -b.lo.y, -b.lo.z}, u32(ref), {b.hi.x, b.hi.y, b.hi.z}, 0};
            if (search.seen(hash_of(boxes[next]), u32(ref), same))
                counter.add(*member, LeftOutCause::COPY);
            else
                ++next;
        }
        filled[begin / GATHER_CHUNK] = next - begin;
        counter.add_to(group, mutex);
    });
    size_t next = filled.empty() ? 0 : filled[0];
    for (size_t chunk = 1; chunk < filled.size(); ++chunk) {
        if (next != chunk * GATHER_CHUNK)
            std::copy_n(boxes.data() + chunk * GATHER_CHUNK, filled[chunk], boxes.data() + next);
        next += filled[chunk];
    }
    // Few things, many times: there may be more from chunk to chunk, and little is left to search.
    if (group.duplicates > next) next = search_all(boxes.data(), next, gather, group);
    *kept = next;
    return boxes;
}

}  // namespace luch::cpu
