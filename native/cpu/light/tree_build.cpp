// Builds the sixteen-wide light tree: top down, always cutting the range that is worst known next. A cut is the
// best of binned candidates by the surface area orientation heuristic (Conty Estevez and Kulla 2018, section 4.4).
#include <algorithm>
#include <array>
#include <cmath>

#include "cpu/light/build.h"

#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

constexpr int BINS = 12;
constexpr u32 MANY = 4096;           // ranges of more are cut across their longest side only
constexpr int DEEPEST_HEURISTIC = 24;  // below this depth ranges are halved by count: no pile is bottomless

struct Item {
    EmitterBounds e;
    Vec3 center;
    u32 index;
};

// Sums over emitters: what the cuts are judged by and what a lane keeps.
struct Bounds {
    Vec3 low{1e38f, 1e38f, 1e38f}, high{-1e38f, -1e38f, -1e38f};
    Vec3 mean{0.0f, 0.0f, 0.0f};  // normals by intensity, sum
    float intensity = 0.0f, omni = 0.0f;
    float emission_rad = 0.0f;
    u32 count = 0, two_sided = 0;
};

void grow(Bounds* b, const Item& item) {
    const EmitterBounds& e = item.e;
    b->low = min_v(b->low, e.low);
    b->high = max_v(b->high, e.high);
    b->intensity += e.intensity;
    b->omni += e.omni ? e.intensity : 0.0f;
    // Two-sided normals have no sign of their own: add them on one side.
    float sign = e.two_sided && dot(b->mean, e.axis) < 0.0f ? -e.intensity : e.intensity;
    b->mean += e.axis * sign;
    b->emission_rad = max_f(b->emission_rad, e.emission_rad);
    b->two_sided += e.two_sided ? 1u : 0u;
    b->count += 1u;
}

void grow(Bounds* b, const Bounds& other) {
    if (other.count == 0) return;
    b->low = min_v(b->low, other.low);
    b->high = max_v(b->high, other.high);
    b->intensity += other.intensity;
    b->omni += other.omni;
    b->mean += other.mean * (other.two_sided == other.count && dot(b->mean, other.mean) < 0.0f ? -1.0f : 1.0f);
    b->emission_rad = max_f(b->emission_rad, other.emission_rad);
    b->two_sided += other.two_sided;
    b->count += other.count;
}

// How widely the light of a range scatters: 0.1 for one normal, 1.1 for all directions. Stands for the solid angle
// of its cone in the heuristic, without the cost of cones.
float orientation_measure(const Bounds& b) {
    float agreement = b.intensity > 0.0f ? min_f(length(b.mean) / b.intensity, 1.0f) : 0.0f;
    float omni = b.intensity > 0.0f ? b.omni / b.intensity : 0.0f;
    return mix_f(1.1f - agreement, 1.1f, omni);
}

// By the diagonal, not the surface: lamps on a line or in a plane have extent too.
float cost_measure(const Bounds& b) {
    if (b.count == 0) return 0.0f;
    return b.intensity * (length_squared(b.high - b.low) + LEAST_DIAGONAL2) * orientation_measure(b);
}

// A cone that holds all normals of a range: around their mean, as wide as the farthest.
struct Cone {
    Vec3 axis{0.0f, 0.0f, 1.0f};
    float normals_rad = 0.0f;
    bool two_sided = false;
};

Cone cone_of(const Item* begin, const Item* end, const Bounds& b) {
    Cone cone;
    cone.two_sided = b.two_sided == b.count;
    cone.axis = normalize_or(b.mean, begin->e.axis);
    if (b.two_sided != 0 && !cone.two_sided) {  // of both kinds
        cone.normals_rad = PI;
        return cone;
    }
    float least = 1.0f, widest = 0.0f;
    for (const Item* i = begin; i < end; ++i) {
        float c = dot(cone.axis, i->e.axis);
        least = min_f(least, cone.two_sided ? abs_f(c) : c);
        widest = max_f(widest, i->e.normals_rad);
    }
    float angle = end - begin == 1 ? 0.0f : std::acos(clamp_f(least, -1.0f, 1.0f)) + LIGHT_CONE_MARGIN;
    cone.normals_rad = min_f(angle + widest, PI);
    return cone;
}

float component(Vec3 v, int axis) { return axis == 0 ? v.x : (axis == 1 ? v.y : v.z); }

struct Range {
    u32 begin, end, node;   // node: the one it becomes
    Bounds bounds;
    int depth;
    u32 count() const { return end - begin; }
};

class Builder {
 public:
    Builder(const std::vector<EmitterBounds>& emitters, std::vector<LightTreeNode>* nodes, std::vector<u32>* slots)
        : nodes_(*nodes), slots_(*slots), items_(emitters.size()) {
        for (u32 i = 0; i < items_.size(); ++i)
            items_[i] = {emitters[i], emitters[i].low * 0.5f + emitters[i].high * 0.5f, i};
        nodes_.clear();
        slots_.assign(emitters.size(), NONE);
    }

    void build() {
        if (items_.empty()) return;
        nodes_.emplace_back(empty_node());
        std::vector<Range> open{
            Range{0, static_cast<u32>(items_.size()), 0, measure(0, static_cast<u32>(items_.size())), 0}};
        while (!open.empty()) {
            Range range = open.back();
            open.pop_back();
            fill_node(range, &open);
        }
    }

 private:
    static LightTreeNode empty_node() {
        LightTreeNode node{};
        node.parent_slot = NONE;
        for (int i = 0; i < LIGHT_WIDTH; ++i) {
            node.child[i] = NONE;
            node.axis_z[i] = 1.0f;
            node.fold[i] = 1.0f;
            node.cos_reach[i] = -2.0f;
        }
        return node;
    }

    Bounds measure(u32 begin, u32 end) const {
        Bounds b;
        for (u32 i = begin; i < end; ++i) grow(&b, items_[i]);
        return b;
    }

    // Among parts of more than `least` emitters the one worst known; parts.size(): none.
    static size_t worst_part(const std::vector<Range>& parts, u32 least, u32 most) {
        size_t worst = parts.size();
        float worst_cost = -1.0f;
        for (size_t i = 0; i < parts.size(); ++i) {
            if (parts[i].count() <= least || parts[i].count() > most) continue;
            float cost = cost_measure(parts[i].bounds);
            cost = finite_f(cost) ? cost : 3e38f;
            if (cost > worst_cost) {
                worst_cost = cost;
                worst = i;
            }
        }
        return worst;
    }

    void split(std::vector<Range>* parts, size_t at) {
        Range part = (*parts)[at];
        u32 middle = cut(part);
        (*parts)[at] = Range{part.begin, middle, 0, measure(part.begin, middle), part.depth};
        parts->push_back(Range{middle, part.end, 0, measure(middle, part.end), part.depth});
    }

    void dissolve(std::vector<Range>* parts, size_t at) {
        if ((*parts)[at].count() < 2) return;
        split(parts, at);
        size_t second = parts->size() - 1;
        dissolve(parts, at);
        dissolve(parts, second);
    }

    // Up to LIGHT_WIDTH parts. Large ones are cut first, the worst known first; then whole small ones become
    // single emitters while there is room: nodes at the bottom are full, not two emitters each.
    std::vector<Range> divide(const Range& range) {
        constexpr u32 width = LIGHT_WIDTH;
        std::vector<Range> parts{range};
        while (parts.size() < width) {
            u32 room = width - static_cast<u32>(parts.size());
            size_t next = worst_part(parts, width, NONE);
            if (next == parts.size()) {
                next = worst_part(parts, 1, room + 1);
                if (next < parts.size()) {
                    dissolve(&parts, next);
                    continue;
                }
            }
            if (next == parts.size()) next = worst_part(parts, 1, NONE);
            if (next == parts.size()) break;
            split(&parts, next);
        }
        return parts;
    }

    void fill_node(const Range& range, std::vector<Range>* open) {
        std::vector<Range> parts = divide(range);
        nodes_[range.node].count = static_cast<u32>(parts.size());
        for (size_t lane = 0; lane < parts.size(); ++lane) {
            Range& part = parts[lane];
            u32 slot = range.node * LIGHT_WIDTH + static_cast<u32>(lane);
            set_lane(&nodes_[range.node], lane, part);
            if (part.count() == 1) {
                u32 emitter = items_[part.begin].index;
                nodes_[range.node].child[lane] = emitter | CHILD_IS_EMITTER;
                slots_[emitter] = slot;
                continue;
            }
            part.node = static_cast<u32>(nodes_.size());
            part.depth = range.depth + 1;
            nodes_[range.node].child[lane] = part.node;
            nodes_.emplace_back(empty_node());
            nodes_.back().parent_slot = slot;
            open->push_back(part);
        }
    }

    void set_lane(LightTreeNode* node, size_t i, const Range& part) const {
        const Bounds& b = part.bounds;
        Vec3 middle = b.low * 0.5f + b.high * 0.5f;
        Vec3 half = max_v(b.high - middle, middle - b.low);
        node->center_x[i] = middle.x;
        node->center_y[i] = middle.y;
        node->center_z[i] = middle.z;
        node->half_x[i] = half.x;
        node->half_y[i] = half.y;
        node->half_z[i] = half.z;
        Cone cone = cone_of(items_.data() + part.begin, items_.data() + part.end, b);
        node->axis_x[i] = cone.axis.x;
        node->axis_y[i] = cone.axis.y;
        node->axis_z[i] = cone.axis.z;
        float reach = cone.normals_rad + b.emission_rad;
        node->cos_reach[i] = reach >= PI ? -2.0f : std::cos(reach);
        node->fold[i] = cone.two_sided ? -1.0f : 1.0f;
        Vec3 mean = b.mean * (1.0f / b.intensity);
        node->mean_x[i] = mean.x;
        node->mean_y[i] = mean.y;
        node->mean_z[i] = mean.z;
        node->spread[i] = max_f(1.0f - length_squared(mean), 0.0f);
        node->omni[i] = min_f(b.omni / b.intensity, 1.0f);
        node->intensity[i] = b.intensity;
    }

    u32 halve(const Range& part, int axis) {
        u32 middle = part.begin + part.count() / 2;
        std::nth_element(items_.begin() + part.begin, items_.begin() + middle, items_.begin() + part.end,
                         [axis](const Item& a, const Item& b) {
                             float ca = component(a.center, axis), cb = component(b.center, axis);
                             return ca != cb ? ca < cb : a.index < b.index;
                         });
        return middle;
    }

    // Reorders the part and returns where its second half begins; both are non-empty.
    u32 cut(const Range& part) {
        Vec3 low = make_vec3(1e38f), high = make_vec3(-1e38f);
        for (u32 i = part.begin; i < part.end; ++i) {
            low = min_v(low, items_[i].center);
            high = max_v(high, items_[i].center);
        }
        Vec3 size = high - low;
        int longest = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
        if (part.depth >= DEEPEST_HEURISTIC) return halve(part, longest);
        float best = 3e38f;
        int best_axis = -1, best_bin = 0;
        for (int axis = 0; axis < 3; ++axis) {
            float length = component(size, axis);
            if (!(length > 1e-30f && finite_f(length))) continue;
            if (part.count() > MANY && axis != longest) continue;
            std::array<Bounds, BINS> bins{};
            for (u32 i = part.begin; i < part.end; ++i)
                grow(&bins[bin_of(component(items_[i].center, axis), component(low, axis), length)], items_[i]);
            // Long boxes are cut across.
            try_cuts(bins, component(size, longest) / length, axis, &best, &best_axis, &best_bin);
        }
        if (best_axis < 0) return halve(part, longest);
        float start = component(low, best_axis), length = component(size, best_axis);
        auto middle = std::partition(items_.begin() + part.begin, items_.begin() + part.end, [&](const Item& item) {
            return bin_of(component(item.center, best_axis), start, length) < static_cast<size_t>(best_bin);
        });
        u32 at = static_cast<u32>(middle - items_.begin());
        return at == part.begin || at == part.end ? halve(part, longest) : at;
    }

    static size_t bin_of(float x, float start, float length) {
        int bin = static_cast<int>((x - start) / length * BINS);
        return static_cast<size_t>(std::clamp(bin, 0, BINS - 1));
    }

    static void try_cuts(const std::array<Bounds, BINS>& bins, float regularity, int axis, float* best, int* best_axis,
                         int* best_bin) {
        std::array<Bounds, BINS> right{};
        for (int i = BINS - 1; i > 0; --i) {
            right[i] = bins[i];
            if (i + 1 < BINS) grow(&right[i], right[i + 1]);
        }
        Bounds left;
        for (int i = 1; i < BINS; ++i) {
            grow(&left, bins[i - 1]);
            if (left.count == 0 || right[i].count == 0) continue;
            float cost = regularity * (cost_measure(left) + cost_measure(right[i]));
            if (cost < *best) {
                *best = cost;
                *best_axis = axis;
                *best_bin = i;
            }
        }
    }

    std::vector<LightTreeNode>& nodes_;
    std::vector<u32>& slots_;
    std::vector<Item> items_;
};

}  // namespace

void build_light_tree(const std::vector<EmitterBounds>& bounds, ThreadPool&, std::vector<LightTreeNode>* nodes,
                      std::vector<u32>* slots) {
    Builder(bounds, nodes, slots).build();
}

}  // namespace luch::cpu
