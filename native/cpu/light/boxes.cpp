// The wide box tree over lamps of finite size, for rays that may hit them.
#include <algorithm>
#include <cmath>

#include "cpu/light/build.h"

#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

struct Box {
    Vec3 low, high;
    u32 lamp;
};

bool can_be_hit(const LampView& lamp) {
    if (lamp.kind == LampKind::SUN || lamp.delta || !lamp_emits(lamp)) return false;
    return (lamp.visibility & (lamp.mis ? RAY_ALL : RAY_CAMERA)) != 0u;
}

Box box_of(const LampView& lamp, u32 index) {
    bool ball = lamp.kind == LampKind::SPHERE || lamp.kind == LampKind::DISK;
    Vec3 half = ball ? make_vec3(lamp.radius) : abs_v(lamp.axis_u) * lamp.half_u + abs_v(lamp.axis_v) * lamp.half_v;
    half = half * LAMP_BOX_GROWTH + abs_v(lamp.position) * LAMP_BOX_PLACE + make_vec3(LAMP_BOX_LEAST);
    return {lamp.position - half, lamp.position + half, index};
}

float middle(const Box& b, int axis) { return (b.low + b.high)[axis]; }

class Builder {
 public:
    std::vector<LampBoxNode> nodes;

    u32 build(Box* begin, Box* end) {
        std::vector<std::pair<Box*, Box*>> parts{{begin, end}};
        while (parts.size() < static_cast<size_t>(LAMP_BOX_WIDTH)) {
            auto largest = std::max_element(parts.begin(), parts.end(),
                                            [](auto& a, auto& b) { return a.second - a.first < b.second - b.first; });
            if (largest->second - largest->first < 2) break;
            Box *from = largest->first, *to = largest->second, *at = from + (to - from) / 2;
            halve(from, at, to);
            *largest = {from, at};
            parts.emplace_back(at, to);
        }
        u32 index = static_cast<u32>(nodes.size());
        nodes.emplace_back();
        LampBoxNode node{};
        for (int i = 0; i < LAMP_BOX_WIDTH; ++i) {
            node.low_x[i] = node.low_y[i] = node.low_z[i] = 1.0f;
            node.high_x[i] = node.high_y[i] = node.high_z[i] = -1.0f;
        }
        for (size_t i = 0; i < parts.size(); ++i) {
            auto [from, to] = parts[i];
            Vec3 low = from->low, high = from->high;
            for (Box* b = from; b < to; ++b) {
                low = min_v(low, b->low);
                high = max_v(high, b->high);
            }
            node.low_x[i] = low.x;
            node.low_y[i] = low.y;
            node.low_z[i] = low.z;
            node.high_x[i] = high.x;
            node.high_y[i] = high.y;
            node.high_z[i] = high.z;
            node.child[i] = to - from == 1 ? from->lamp | BOX_IS_LAMP : build(from, to);
        }
        nodes[index] = node;
        return index;
    }

 private:
    static void halve(Box* from, Box* at, Box* to) {
        Vec3 low = make_vec3(1e38f), high = make_vec3(-1e38f);
        for (Box* b = from; b < to; ++b) {
            low = min_v(low, b->low + b->high);
            high = max_v(high, b->low + b->high);
        }
        Vec3 size = high - low;
        int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
        std::nth_element(from, at, to, [axis](const Box& a, const Box& b) {
            float ma = middle(a, axis), mb = middle(b, axis);
            return ma != mb ? ma < mb : a.lamp < b.lamp;
        });
    }
};

}  // namespace

std::vector<LampBoxNode> build_lamp_boxes(const std::vector<LampView>& lamps) {
    std::vector<Box> boxes;
    for (u32 i = 0; i < lamps.size(); ++i)
        if (can_be_hit(lamps[i])) boxes.push_back(box_of(lamps[i], i));
    Builder builder;
    if (!boxes.empty()) builder.build(boxes.data(), boxes.data() + boxes.size());
    return std::move(builder.nodes);
}

}  // namespace luch::cpu
