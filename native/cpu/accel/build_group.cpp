// A group's tree, over the primitives that gather.h finds.
#include <algorithm>
#include <atomic>
#include <stdexcept>

#include "cpu/accel/accel.h"
#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/build_moving.h"
#include "cpu/accel/gather.h"
#include "cpu/accel/group.h"
#include "cpu/accel/slivers.h"
#include "cpu/accel/tree2.h"

namespace luch::cpu {
namespace {

constexpr u32 TRIANGLES_A_BLOCK = 4, SPHERES_A_BLOCK = 8, PIECES_A_BLOCK = 8;

u32 leaf_width(const Group& group) {
    constexpr u32 width[] = {TRIANGLES_A_BLOCK, SPHERES_A_BLOCK, PIECES_A_BLOCK};
    return width[size_t(group.kind)];
}

// The mesh's curves: the scene may go away.
void copy_curves(Group& group, const SceneView& scene) {
    const MeshView& mesh = scene.meshes[group.members[0].mesh];
    group.curves = curves_of(scene, mesh);
    group.curve_segments.assign(group.curves.segments, group.curves.segments + mesh.segment_count);
    u32 points = 0;
    for (u32 word : group.curve_segments) points = std::max(points, (word >> 2) + 2u);
    group.curve_points.assign(group.curves.points, group.curves.points + 4 * size_t(points));
    group.curves.points = group.curve_points.data();
    group.curves.segments = group.curve_segments.data();
}

void fill_block(Block4& block, const u32* refs, u32 count, const Group& group, const Gather& gather) {
    const float nan = bits_float(0x7fc00000u);
    for (u32 lane = 0; lane < 4; ++lane) {
        Corners3 c;
        for (Vec3& p : c.p) p = make_vec3(nan);
        u32 ref = REF_MASK;
        if (lane < count) {
            const Member& member = group.member_of(refs[lane]);
            gather.read(refs[lane], member, &c);
            ref = gather.flagged(refs[lane], member);
        }
        for (int k = 0; k < 3; ++k)
            for (int axis = 0; axis < 3; ++axis) block.vertex[k][axis][lane] = c.p[k][axis];
        block.ref[lane] = ref;
    }
}

void fill_block(SphereBlock& block, const u32* refs, u32 count, const Group& group, const Gather& gather) {
    for (u32 lane = 0; lane < SPHERES_A_BLOCK; ++lane) {
        Sphere s = {make_vec3(0.0f), 0.0f};
        u32 ref = REF_MASK;
        if (lane < count) {
            const Member& member = group.member_of(refs[lane]);
            gather.read(refs[lane], member, &s);
            ref = gather.flagged(refs[lane], member);
        }
        for (int axis = 0; axis < 3; ++axis) block.center[axis][lane] = s.center[axis];
        block.radius[lane] = s.radius;
        block.ref[lane] = ref;
    }
}

void fill_block(CurveBlock& block, const u32* refs, u32 count, const Group& group, const Gather& gather) {
    for (u32 lane = 0; lane < PIECES_A_BLOCK; ++lane) {
        bool here = lane < count;
        // An empty lane repeats the first capsule, and its ref says that it is empty.
        Capsule c = piece_capsule(group.curves, refs[here ? lane : 0]);
        for (int axis = 0; axis < 3; ++axis) {
            block.a[axis][lane] = c.a[axis];
            block.b[axis][lane] = c.b[axis];
        }
        block.radius[lane] = here ? c.radius : 0.0f;
        block.ref[lane] = here ? gather.flagged(refs[lane], group.members[0]) : REF_MASK;
    }
}

// Turns the builder's leaves (ranges of order) into blocks.
void make_blocks(Group& group, const std::vector<u32>& order, const Gather& gather, ThreadPool& pool) {
    const u32 width = leaf_width(group);
    std::vector<u32> first_order;  // per block
    first_order.reserve(order.size() / 3 + 1);
    std::vector<u8> size;
    size.reserve(order.size() / 3 + 1);
    for (size_t n = 0; n < group.nodes.size(); ++n) {
        Node8& node = group.nodes[n];
        for (int slot = 0; slot < 8; ++slot) {
            u32 count = node.count[slot], first = node.child[slot];
            if (count == 0) continue;
            u32 blocks = (count + width - 1) / width, block = u32(first_order.size());
            if (block + blocks > LEAF_FIRST_MASK)
                throw std::length_error("More than a billion primitives in one mesh or scene.");
            node.child[slot] = LEAF | ((blocks - 1) << LEAF_COUNT_SHIFT) | block;
            for (u32 b = 0; b < blocks; ++b) {
                first_order.push_back(first + width * b);
                size.push_back(u8(std::min(width, count - width * b)));
            }
        }
    }
    auto fill = [&](auto& blocks) {
        blocks = std::remove_reference_t<decltype(blocks)>(first_order.size());
        pool.parallel_for(first_order.size(), GATHER_CHUNK / width, [&](size_t begin, size_t end, unsigned) {
            for (size_t b = begin; b < end; ++b) fill_block(blocks[b], &order[first_order[b]], size[b], group, gather);
        });
    };
    if (group.kind == GroupKind::CURVES)
        fill(group.curve_blocks);
    else if (group.kind == GroupKind::SPHERES)
        fill(group.sphere_blocks);
    else
        fill(group.blocks);
}

void fill_flags(Group& group, const std::vector<u32>& refs, const Gather& gather, ThreadPool& pool) {
    std::atomic<bool> any{false};
    group.flags.assign(gather.ref_count(), 0);
    pool.parallel_for(refs.size(), GATHER_CHUNK, [&](size_t begin, size_t end, unsigned) {
        bool found = false;
        for (size_t i = begin; i < end; ++i) {
            if (gather.flagged(refs[i], group.member_of(refs[i])) == refs[i]) continue;
            group.flags[refs[i]] = PRIMITIVE_MAY_BE_TRANSPARENT;
            found = true;
        }
        if (found) any = true;
    });
    if (!any) group.flags = {};
}

// The primitives kept, side by side in order of ref: what builders take.
StructureInput collect(Group& group, const PrimBox* boxes, size_t kept, const Gather& gather, BuildQuality quality,
                       std::vector<u32>* refs_kept, ThreadPool& pool) {
    u32 ref_count = gather.ref_count();
    group.corners.assign(group.kind == GroupKind::TRIANGLES ? 9 * size_t(ref_count) : 0, 0.0f);
    group.spheres.assign(group.kind == GroupKind::SPHERES ? 4 * size_t(ref_count) : 0, 0.0f);
    std::vector<u32>& refs = *refs_kept;
    refs.resize(kept);
    pool.parallel_for(kept, GATHER_CHUNK, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            u32 ref = refs[i] = boxes[i].id;
            if (group.kind == GroupKind::CURVES) continue;  // lie in the group already
            if (group.kind == GroupKind::SPHERES) {
                Sphere s;
                gather.read(ref, group.member_of(ref), &s);
                std::copy_n(&s.center.x, 4, group.spheres.data() + 4 * size_t(ref));
                continue;
            }
            Corners3 c;
            gather.read(ref, group.member_of(ref), &c);
            std::copy_n(&c.p[0].x, 9, group.corners.data() + 9 * size_t(ref));
        }
    });
    if (gather.has_flags()) fill_flags(group, refs, gather, pool);
    Primitives all = {group.corners.data(),
                      group.spheres.data(),
                      group.flags.empty() ? nullptr : group.flags.data(),
                      group.kind == GroupKind::TRIANGLES ? ref_count : 0,
                      group.kind == GroupKind::SPHERES ? ref_count : 0,
                      group.curves};
    return {all, refs.data(), u32(kept), quality};
}

void make_structure(Group& group, const PrimBox* boxes, size_t kept, const Gather& gather, const AccelChoice& choice,
                    ThreadPool& pool) {
    std::vector<u32> refs;
    StructureInput input = collect(group, boxes, kept, gather, choice.quality, &refs, pool);
    // Devices do not cut slivers.
    group.left =
        group.kind == GroupKind::TRIANGLES && kept >= choice.leave_from && boxes_met(boxes, kept, pool) < MANY_BOXES;
    if (!group.left) group.structure = build_structure(choice.kind, input, pool);
}

// Boxes for the wide tree's own builder, which knows no triangles.
HugeArray<PrimBox> boxes_in_pieces(Group& group, HugeArray<PrimBox> boxes, size_t* kept, const Gather& gather,
                                   ThreadPool& pool) {
    if (group.kind != GroupKind::TRIANGLES || boxes_met(boxes.data(), *kept, pool) < MANY_BOXES) return boxes;
    std::vector<u32> refs;
    StructureInput input = collect(group, boxes.data(), *kept, gather, BuildQuality::NORMAL, &refs, pool);
    boxes = cut_slivers(input.primitives, std::move(boxes), kept, pool);
    group.corners = {};
    group.flags = {};
    return boxes;
}

// The wide tree by a binary builder of the quality asked for.
Tree8 collapse_tree(Group& group, const PrimBox* boxes, size_t kept, const Gather& gather, const AccelChoice& choice,
                    ThreadPool& pool) {
    std::vector<u32> refs;
    StructureInput input = collect(group, boxes, kept, gather, choice.quality, &refs, pool);
    const u32 width = leaf_width(group);
    Tree8 tree = collapse_bvh8(build_tree2(input, width, pool), width, pool);
    group.corners = {};
    group.spheres = {};
    group.flags = {};
    return tree;
}

}  // namespace

void add_left_out(const LeftOut& more, std::vector<LeftOut>* all) {
    auto found =
        std::lower_bound(all->begin(), all->end(), more.mesh, [](const LeftOut& a, u32 mesh) { return a.mesh < mesh; });
    if (found == all->end() || found->mesh != more.mesh) found = all->insert(found, {more.mesh});
    found->invalid += more.invalid;
    found->too_far += more.too_far;
    found->empty += more.empty;
    found->copies += more.copies;
}

Group::Group() = default;
Group::Group(Group&&) noexcept = default;
Group& Group::operator=(Group&&) noexcept = default;
Group::~Group() = default;

void build_group(Group& group, const SceneView& scene, const std::vector<std::vector<u8>>& flags,
                 const AccelChoice& choice, ThreadPool& pool) {
    if (group.deforms) return build_moving_group(group, scene, flags, choice, pool);
    if (group.kind == GroupKind::CURVES) copy_curves(group, scene);
    Gather gather(group, scene, flags);
    size_t kept = 0;
    HugeArray<PrimBox> boxes = gather_boxes(group, gather, pool, &kept);
    group.kept = kept;
    group.dropped = gather.ref_count() - kept - group.duplicates;
    group.root = empty_box();
    if (kept == 0) return;
    group.precision = choice.precision;
    if (!choice.wide) {
        for (size_t i = 0; i < kept; ++i)
            extend(group.root, {{-boxes[i].minus_lo[0], -boxes[i].minus_lo[1], -boxes[i].minus_lo[2]},
                                {boxes[i].hi[0], boxes[i].hi[1], boxes[i].hi[2]}});
        return make_structure(group, boxes.data(), kept, gather, choice, pool);
    }
    if (choice.quality == BuildQuality::NORMAL) boxes = boxes_in_pieces(group, std::move(boxes), &kept, gather, pool);
    Tree8 tree = choice.quality == BuildQuality::NORMAL
                     ? build_bvh8(std::move(boxes), kept, leaf_width(group), pool)
                     : collapse_tree(group, boxes.data(), kept, gather, choice, pool);
    group.nodes = std::move(tree.nodes);
    group.root = tree.root;
    make_blocks(group, tree.order, gather, pool);
}

}  // namespace luch::cpu
