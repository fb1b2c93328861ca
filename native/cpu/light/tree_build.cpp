// Builds the sixteen-wide light tree: top down, always cutting the range that is worst known next. A cut is the
// best of binned candidates by the surface area orientation heuristic (Conty Estevez and Kulla 2018, section 4.4).
#include <algorithm>
#include <array>
#include <cmath>

#include "cpu/light/build.h"

namespace luch::cpu {
namespace {

constexpr int BINS = 12;
constexpr int DEEPEST_HEURISTIC = 24;  // below this depth ranges are halved by count: no pile is bottomless

struct Cone {
    Vec3 axis{0.0f, 0.0f, 1.0f};
    float normals = -1.0f, emission = 0.0f;  // normals < 0: empty
    bool two_sided = false;
};

Vec3 rotate(Vec3 v, Vec3 unit_axis, float angle) {
    float c = std::cos(angle), s = std::sin(angle);
    return v * c + cross(unit_axis, v) * s + unit_axis * (dot(unit_axis, v) * (1.0f - c));
}

// Smallest cone around both, near enough. Two-sided normals may be flipped; beside one-sided ones they are both.
Cone merge(Cone a, Cone b) {
    if (a.normals < 0.0f) return b;
    if (b.normals < 0.0f) return a;
    Cone r = a.normals >= b.normals ? a : b;
    const Cone& small = a.normals >= b.normals ? b : a;
    r.emission = max_f(a.emission, b.emission);
    if (a.two_sided != b.two_sided) {
        r.normals = PI;
        r.two_sided = false;
        return r;
    }
    Vec3 other = (r.two_sided && dot(r.axis, small.axis) < 0.0f) ? -small.axis : small.axis;
    float between = std::atan2(length(cross(r.axis, other)), dot(r.axis, other));
    if (between + small.normals <= r.normals) return r;
    float half = 0.5f * (between + r.normals + small.normals);
    if (half >= PI) {
        r.normals = PI;
        return r;
    }
    Vec3 turn = normalize_or(cross(r.axis, other), {0.0f, 0.0f, 0.0f});
    if (is_zero(turn)) {  // opposite axes: any common cone is everything
        r.normals = PI;
        return r;
    }
    r.axis = normalize_or(rotate(r.axis, turn, half - r.normals), r.axis);
    r.normals = half;
    return r;
}

struct Bounds {
    Vec3 low{1e38f, 1e38f, 1e38f}, high{-1e38f, -1e38f, -1e38f};
    Cone cone;
    double intensity = 0.0, omni = 0.0;
    double mean[3] = {0.0, 0.0, 0.0};  // normals by intensity, sum
    u32 count = 0;
};

void grow(Bounds* b, const Bounds& other) {
    if (other.count == 0) return;
    b->low = min_v(b->low, other.low);
    b->high = max_v(b->high, other.high);
    b->cone = merge(b->cone, other.cone);
    b->intensity += other.intensity;
    b->omni += other.omni;
    // Two-sided normals have no sign of their own: add them on one side.
    double along = b->mean[0] * other.mean[0] + b->mean[1] * other.mean[1] + b->mean[2] * other.mean[2];
    double sign = other.cone.two_sided && along < 0.0 ? -1.0 : 1.0;
    for (int i = 0; i < 3; ++i) b->mean[i] += sign * other.mean[i];
    b->count += other.count;
}

Bounds bounds_of(const EmitterBounds& e) {
    Bounds b;
    b.low = e.low;
    b.high = e.high;
    b.cone = {e.axis, e.normals_rad, e.emission_rad, e.two_sided};
    b.intensity = e.intensity;
    b.count = 1;
    b.omni = e.omni ? e.intensity : 0.0f;
    for (int i = 0; i < 3; ++i) b.mean[i] = static_cast<double>(e.intensity) * e.axis[i];
    return b;
}

// Solid angle that the light of a cone of normals covers, weighted by its fall-off.
float orientation_measure(const Cone& c) {
    if (c.normals < 0.0f) return 0.0f;
    float o = c.normals, w = std::min(o + c.emission, PI);
    float measure = TWO_PI * (1.0f - std::cos(o)) +
                    HALF_PI * (2.0f * w * std::sin(o) - std::cos(o - 2.0f * w) - 2.0f * o * std::sin(o) + std::cos(o));
    return c.two_sided ? min_f(2.0f * measure, 2.0f * TWO_PI) : measure;
}

// By the diagonal, not the surface: lamps on a line or in a plane have extent too.
float extent_measure(const Bounds& b) { return b.count == 0 ? 0.0f : length_squared(b.high - b.low); }

float cost_measure(const Bounds& b) {
    return static_cast<float>(b.intensity) * (extent_measure(b) + 1e-12f) * orientation_measure(b.cone);
}

Vec3 center(const EmitterBounds& e) { return (e.low + e.high) * 0.5f; }
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
        : emitters_(emitters), nodes_(*nodes), slots_(*slots), order_(emitters.size()) {
        for (u32 i = 0; i < order_.size(); ++i) order_[i] = i;
        nodes_.clear();
        slots_.assign(emitters.size(), NONE);
    }

    void build() {
        if (order_.empty()) return;
        nodes_.emplace_back(empty_node());
        std::vector<Range> open{Range{0, static_cast<u32>(order_.size()), 0, measure(0, static_cast<u32>(order_.size())), 0}};
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
        for (u32 i = begin; i < end; ++i) grow(&b, bounds_of(emitters_[order_[i]]));
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
            set_lane(&nodes_[range.node], lane, part.bounds);
            if (part.count() == 1) {
                u32 emitter = order_[part.begin];
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

    static void set_lane(LightTreeNode* node, size_t i, const Bounds& b) {
        Vec3 middle = b.low * 0.5f + b.high * 0.5f;
        Vec3 half = max_v(b.high - middle, middle - b.low);
        node->center_x[i] = middle.x;
        node->center_y[i] = middle.y;
        node->center_z[i] = middle.z;
        node->half_x[i] = half.x;
        node->half_y[i] = half.y;
        node->half_z[i] = half.z;
        node->axis_x[i] = b.cone.axis.x;
        node->axis_y[i] = b.cone.axis.y;
        node->axis_z[i] = b.cone.axis.z;
        double total = std::max(b.intensity, 1e-300);
        float m[3], square = 0.0f;
        for (int k = 0; k < 3; ++k) {
            m[k] = static_cast<float>(b.mean[k] / total);
            square += m[k] * m[k];
        }
        node->mean_x[i] = m[0];
        node->mean_y[i] = m[1];
        node->mean_z[i] = m[2];
        node->spread[i] = max_f(1.0f - square, 0.0f);
        node->omni[i] = static_cast<float>(b.omni / total);
        float reach = b.cone.normals + b.cone.emission;
        node->cos_reach[i] = reach >= PI ? -2.0f : std::cos(reach);
        node->fold[i] = b.cone.two_sided ? -1.0f : 1.0f;
        node->intensity[i] = static_cast<float>(std::clamp(b.intensity, 1e-30, 1e30));
    }

    u32 halve(const Range& part, int axis) {
        u32 middle = part.begin + part.count() / 2;
        std::nth_element(order_.begin() + part.begin, order_.begin() + middle, order_.begin() + part.end, [&](u32 a, u32 b) {
            float ca = component(center(emitters_[a]), axis), cb = component(center(emitters_[b]), axis);
            return ca != cb ? ca < cb : a < b;
        });
        return middle;
    }

    // Reorders the part and returns where its second half begins; both are non-empty.
    u32 cut(const Range& part) {
        Vec3 low = make_vec3(1e38f), high = make_vec3(-1e38f);
        for (u32 i = part.begin; i < part.end; ++i) {
            low = min_v(low, center(emitters_[order_[i]]));
            high = max_v(high, center(emitters_[order_[i]]));
        }
        Vec3 size = high - low;
        int longest = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
        if (part.depth >= DEEPEST_HEURISTIC) return halve(part, longest);
        float best = 3e38f;
        int best_axis = -1, best_bin = 0;
        for (int axis = 0; axis < 3; ++axis) {
            float length = component(size, axis);
            if (!(length > 1e-30f && finite_f(length))) continue;
            std::array<Bounds, BINS> bins{};
            for (u32 i = part.begin; i < part.end; ++i) {
                const EmitterBounds& e = emitters_[order_[i]];
                grow(&bins[bin_of(component(center(e), axis), component(low, axis), length)], bounds_of(e));
            }
            // Long boxes are cut across.
            try_cuts(bins, component(size, longest) / length, axis, &best, &best_axis, &best_bin);
        }
        if (best_axis < 0) return halve(part, longest);
        float start = component(low, best_axis), length = component(size, best_axis);
        auto middle = std::partition(order_.begin() + part.begin, order_.begin() + part.end, [&](u32 e) {
            return bin_of(component(center(emitters_[e]), best_axis), start, length) < static_cast<size_t>(best_bin);
        });
        u32 at = static_cast<u32>(middle - order_.begin());
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

    const std::vector<EmitterBounds>& emitters_;
    std::vector<LightTreeNode>& nodes_;
    std::vector<u32>& slots_;
    std::vector<u32> order_;
};

}  // namespace

void build_light_tree(const std::vector<EmitterBounds>& bounds, ThreadPool&, std::vector<LightTreeNode>* nodes,
                      std::vector<u32>* slots) {
    Builder(bounds, nodes, slots).build();
}

}  // namespace luch::cpu
