#include "cpu/accel/build_moving.h"

#include <algorithm>
#include <cmath>

namespace luch::cpu {
namespace {

constexpr u32 MAX_LEAF = 4;  // refs
// The way between two keys is followed in steps: an arc of a radian leaves the chord of one by its sagitta.
constexpr float STEPS_A_RADIAN = 8.0f;
constexpr u32 MOST_STEPS = 64;
constexpr float SAGITTA_SLACK = 1.25f;  // the chord that is taken for a short arc is not walked at even speed

Vec3 corner_at(const SceneView& scene, u32 mesh_index, u32 key, u32 vertex) {
    const MeshMotion& motion = scene.motion->meshes[mesh_index];
    return vec3_row(scene.motion->positions,
                    motion.first_position + u64(key) * scene.meshes[mesh_index].vertex_count + vertex);
}

// Its corners at every key, if it can be traced at all of them; it may have no area at some.
bool read_triangle(const SceneView& scene, u32 mesh_index, u32 prim, u32 keys, std::vector<Vec3>* corners) {
    const MeshView& mesh = scene.meshes[mesh_index];
    const u32* index = corners_of(scene, mesh, prim);
    if (index[0] >= mesh.vertex_count || index[1] >= mesh.vertex_count || index[2] >= mesh.vertex_count) return false;
    bool area = false;
    for (u32 key = 0; key < keys; ++key) {
        Vec3* p = corners->data() + 3 * key;
        for (int k = 0; k < 3; ++k) {
            p[k] = corner_at(scene, mesh_index, key, index[k]);
            if (!point_can_be_traced(p[k])) return false;
        }
        area = area || triangle_has_area(p[0], p[1], p[2]);
    }
    return area;
}

void gather_corners(Group& group, const SceneView& scene, u32 keys, std::vector<u32>* refs) {
    MovingTrees& moving = *group.moving;
    u32 mesh = group.members[0].mesh, count = scene.meshes[mesh].triangle_count;
    moving.rows.assign(size_t(keys) * count * 9, 0.0f);
    std::vector<Vec3> corners(3 * size_t(keys));
    for (u32 prim = 0; prim < count; ++prim) {
        if (!read_triangle(scene, mesh, prim, keys, &corners)) continue;
        refs->push_back(prim);
        for (u32 key = 0; key < keys; ++key)
            for (u32 k = 0; k < 3; ++k) {
                const Vec3 p = corners[3 * key + k];
                float* out = moving.rows.data() + 9 * (size_t(key) * count + prim) + 3 * k;
                out[0] = p.x, out[1] = p.y, out[2] = p.z;
            }
    }
    moving.view.stride = 9 * u64(count);
    moving.view.pieces = keys - 1;
}

// The mesh's curves at every key: the scene may go away. refs: pieces that can be traced at all of them, though at some
// they may have no radius.
void gather_curves(Group& group, const SceneView& scene, std::vector<u32>* refs) {
    MovingTrees& moving = *group.moving;
    const MeshView& mesh = scene.meshes[group.members[0].mesh];
    const MeshMotion& motion = scene.motion->meshes[group.members[0].mesh];
    CurveSet curves = curves_of(scene, mesh);
    moving.segments.assign(curves.segments, curves.segments + mesh.segment_count);
    curves.segments = moving.segments.data();
    u64 stride = 4 * u64(motion.curve_point_count);
    const float* first = scene.motion->curve_points + 4 * u64(motion.first_curve_point);
    moving.rows.assign(first, first + stride * motion.curve_key_count);
    for (u32 piece = 0; piece < piece_count(curves); ++piece) {
        bool finite = true, thick = false;
        for (u32 key = 0; key < motion.curve_key_count; ++key) {
            curves.points = moving.rows.data() + stride * key;
            finite = finite && piece_is_finite(curves, piece);
            thick = thick || piece_has_radius(curves, piece);
        }
        if (finite && thick) refs->push_back(piece);
    }
    curves.points = moving.rows.data();
    moving.view.stride = stride;
    moving.view.pieces = motion.curve_key_count - 1;
    moving.view.curves = curves;
}

float row_sum(const Affine& a, int row) {
    return abs_f(a.m[4 * row]) + abs_f(a.m[4 * row + 1]) + abs_f(a.m[4 * row + 2]);
}

u32 steps_between(const TransformKey& a, const TransformKey& b, float* angle) {
    float cosine = 0.0f;
    for (int i = 0; i < 4; ++i) cosine += a.rotation[i] * b.rotation[i];
    *angle = 2.0f * std::acos(std::clamp(cosine, -1.0f, 1.0f));
    return std::clamp(u32(std::ceil(*angle * STEPS_A_RADIAN)), 1u, MOST_STEPS);
}

// How far the way of a point of the box leaves its chord within a step: an eighth of the square of the step times the
// second derivative, of R(t) S(t) x at most angle^2 |S x| + 2 angle |S' x|.
float chord_error(const TransformKey& a, const TransformKey& b, float angle, u32 steps, const Box& box) {
    Vec3 reach = max_v(abs_v(box.lo), abs_v(box.hi));
    auto stretched = [&](auto&& entry) {
        Vec3 out;
        float rows[3];
        for (int row = 0; row < 3; ++row)
            rows[row] = entry(3 * row) * reach.x + entry(3 * row + 1) * reach.y + entry(3 * row + 2) * reach.z;
        out = {rows[0], rows[1], rows[2]};
        return length(out);
    };
    float size = stretched([&](int i) { return max_f(abs_f(a.stretch[i]), abs_f(b.stretch[i])); });
    float change = stretched([&](int i) { return abs_f(b.stretch[i] - a.stretch[i]); });
    float step = 1.0f / float(steps);
    return SAGITTA_SLACK * 0.125f * step * step * (angle * angle * size + 2.0f * angle * change);
}

void extend_by_corners(Box& out, const Affine& to_world, const Box& box, float margin) {
    for (int corner = 0; corner < 8; ++corner) {
        Vec3 p = transform_point(to_world, {corner & 1 ? box.hi.x : box.lo.x, corner & 2 ? box.hi.y : box.lo.y,
                                            corner & 4 ? box.hi.z : box.lo.z});
        extend(out, p - make_vec3(margin));
        extend(out, p + make_vec3(margin));
    }
}

}  // namespace

u64 MovingTrees::nodes() const {
    u64 sum = 0;
    for (const Tree2& tree : trees) sum += tree.nodes.size();
    return sum;
}
u64 MovingTrees::bytes() const {
    u64 sum = rows.size() * sizeof(float) + segments.size() * sizeof(u32) + flags.size() + views.size() * sizeof(Bvh2);
    for (const Tree2& tree : trees) sum += tree.nodes.size() * sizeof(Bvh2Node) + tree.refs.size() * sizeof(u32);
    return sum;
}
u32 MovingTrees::depth() const {
    u32 deepest = 0;
    for (const Tree2& tree : trees) deepest = std::max(deepest, tree.depth);
    return deepest;
}

void build_moving_group(Group& group, const SceneView& scene, const std::vector<std::vector<u8>>& flags,
                        const AccelChoice& choice, ThreadPool& pool) {
    group.moving = std::make_unique<MovingTrees>();
    MovingTrees& moving = *group.moving;
    const Member& member = group.members[0];
    std::vector<u32> refs;
    if (group.kind == GroupKind::CURVES)
        gather_curves(group, scene, &refs);
    else
        gather_corners(group, scene, scene.motion->meshes[member.mesh].key_count, &refs);
    group.kept = refs.size();
    group.dropped = member.prim_count - group.kept;
    group.precision = choice.precision;
    group.root = empty_box();
    if (refs.empty()) return;
    if (!flags.empty() && !flags[member.mesh].empty()) {
        const u8* own = flags[member.mesh].data() + member.first_prim;
        moving.flags.assign(own, own + member.prim_count);
    }
    moving.view.rows = moving.rows.data();
    moving.view.flags = moving.flags.empty() ? nullptr : moving.flags.data();
    for (u32 piece = 0; piece < moving.view.pieces; ++piece) {
        HugeArray<PrimBox> boxes(refs.size());
        MovingPrimitives all = primitives_at(moving.view, {piece, 0.0f});
        for (size_t i = 0; i < refs.size(); ++i) {
            Box b = primitive_box(all, refs[i]);
            boxes[i] = {{-b.lo.x, -b.lo.y, -b.lo.z}, refs[i], {b.hi.x, b.hi.y, b.hi.z}, 0};
        }
        moving.trees.push_back(build_tree2_binned(std::move(boxes), refs.size(), MAX_LEAF, HALVING_LEVEL, pool));
    }
    for (const Tree2& tree : moving.trees) {
        moving.views.push_back({tree.nodes.data(), tree.refs.data(), tree.root, u32(tree.nodes.size())});
        extend(group.root, tree.root);
    }
    moving.view.trees = moving.views.data();
}

u32 SceneMotion::add(const SceneView& scene, u32 instance, u32 deformed) {
    InstanceMotion way = scene.motion ? scene.motion->instances[instance] : InstanceMotion{};
    if (way.key_count == 0 && deformed == NONE) return 0;
    const TransformKey* own = scene.motion->keys + way.first_key;
    way.first_key = u32(keys.size());
    keys.insert(keys.end(), own, own + way.key_count);
    if (way.slide) {
        slides.push_back(scene.motion->slides[way.slide - 1]);
        way.slide = u32(slides.size());
    }
    entries.push_back({way, deformed});
    return u32(entries.size());
}

void SceneMotion::finish(const std::vector<Group>& built) {
    std::vector<u32> number(built.size(), NONE);
    for (size_t g = 0; g < built.size(); ++g) {
        if (!built[g].deforms) continue;
        number[g] = u32(groups.size());
        groups.push_back(built[g].moving->view);
    }
    for (EntryMotion& entry : entries)
        if (entry.group != NONE) entry.group = number[entry.group];
    view = {entries.data(), keys.data(), slides.data(), groups.data()};
}

void SceneMotion::describe(DeviceImage& image, u32 block, const TraceMotion* const& pointer,
                           const std::vector<Group>& built) const {
    u32 motion = image.add_array("motion", block, pointer, 1);
    image.add_array("moving entries", motion, view.entries, entries.size());
    image.add_array("motion keys", motion, view.keys, keys.size());
    image.add_array("slides", motion, view.slides, slides.size());
    u32 moving = image.add_array("moving groups", motion, view.groups, groups.size());
    size_t next = 0;
    for (const Group& group : built) {
        if (!group.moving) continue;
        const MovingTrees& trees = *group.moving;
        const MovingGroup& own = groups[next++];
        image.add_array("moving rows", moving, own.rows, trees.rows.size());
        if (!trees.segments.empty())
            image.add_array("moving segments", moving, own.curves.segments, trees.segments.size());
        image.add_array("moving flags", moving, own.flags, trees.flags.size());
        u32 views = image.add_array("moving trees", moving, own.trees, trees.views.size());
        for (size_t piece = 0; piece < trees.views.size(); ++piece) {
            image.add_array("moving nodes", views, trees.views[piece].nodes, trees.trees[piece].nodes.size());
            image.add_array("moving refs", views, trees.views[piece].refs, trees.trees[piece].refs.size());
        }
    }
}

Box swept_box(const TransformKey* keys, u32 key_count, const Box& box) {
    Box out = empty_box();
    for (u32 key = 0; key + 1 < key_count; ++key) {
        float angle;
        u32 steps = steps_between(keys[key], keys[key + 1], &angle);
        float margin = chord_error(keys[key], keys[key + 1], angle, steps, box);
        for (u32 step = 0; step <= steps; ++step)
            extend_by_corners(out, transform_between(keys[key], keys[key + 1], float(step) / float(steps)), box,
                              margin);
    }
    return out;
}

float swept_condition(const TransformKey* keys, u32 key_count) {
    float worst = 0.0f;
    for (u32 key = 0; key + 1 < key_count; ++key) {
        float angle;
        u32 steps = steps_between(keys[key], keys[key + 1], &angle);
        for (u32 step = 0; step <= steps; ++step) {
            Affine to_world = transform_between(keys[key], keys[key + 1], float(step) / float(steps));
            Affine to_object = inverse_of(to_world);
            float world = 0.0f, object = 0.0f;
            for (int row = 0; row < 3; ++row) {
                world = max_f(row_sum(to_world, row), world);
                object = max_f(row_sum(to_object, row), object);
            }
            worst = max_f(world * object, worst);
        }
    }
    return worst;
}

}  // namespace luch::cpu
