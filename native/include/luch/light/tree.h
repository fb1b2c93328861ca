// The light tree: which emitter to sample, from where the shaded point stands. Sixteen children a node, so that a
// thousand lamps are three steps and every step is one vector operation over the children; a finer choice per step
// also strays less from the true shares than sixteen halvings through coarse bounds.
// Bounds of position and direction: Conty Estevez and Kulla 2018, "Importance sampling of many lights with adaptive
// tree splitting".
#pragma once
#include "luch/light/light.h"
#include "luch/sampling/hash.h"

namespace luch {

inline constexpr int LIGHT_WIDTH = 16;
inline constexpr u32 CHILD_IS_EMITTER = 0x80000000u;

// Every child, node or single emitter alike: a box, a cone of normals, an intensity.
struct alignas(64) LightTreeNode {
    float center_x[LIGHT_WIDTH], center_y[LIGHT_WIDTH], center_z[LIGHT_WIDTH];
    float half_x[LIGHT_WIDTH], half_y[LIGHT_WIDTH], half_z[LIGHT_WIDTH];  // of the box
    float axis_x[LIGHT_WIDTH], axis_y[LIGHT_WIDTH], axis_z[LIGHT_WIDTH];  // of the cone that holds all normals
    float cos_normals[LIGHT_WIDTH];   // half angle of that cone
    float sin_normals[LIGHT_WIDTH];
    float cos_reach[LIGHT_WIDTH];     // of the cone that holds all light; -2: everywhere
    float two_sided[LIGHT_WIDTH];     // 1: light leaves along -normal too
    float intensity[LIGHT_WIDTH];     // W/sr along the axis, all emitters together; 0: no child
    u32 child[LIGHT_WIDTH];           // node, or emitter | CHILD_IS_EMITTER
    u32 parent_slot;                  // LIGHT_WIDTH * node + lane above; NONE: the root
    u32 count;                        // children
};

struct Emitter {
    u32 lamp;            // NONE: a triangle
    u32 instance, prim;
    u32 slot;            // LIGHT_WIDTH * node + lane where it hangs
};

// Where light is wanted. normal_weight 0: in a volume, or from all sides.
struct LightQuery {
    Vec3 p, n;
    bool transmits, volume;
};

LUCH_FN LightQuery make_light_query(Vec3 p, Vec3 n, bool transmits) { return {p, n, transmits, is_zero(n)}; }

// Irradiance that one child may give, roughly; 0 only if it gives none. Slack keeps rounding from cutting off light.
LUCH_FN float child_importance(const LightTreeNode& node, int i, const LightQuery& q) {
    float dx = node.center_x[i] - q.p.x, dy = node.center_y[i] - q.p.y, dz = node.center_z[i] - q.p.z;
    float hx = node.half_x[i], hy = node.half_y[i], hz = node.half_z[i];
    float d2 = dx * dx + dy * dy + dz * dz, r2 = hx * hx + hy * hy + hz * hz;
    bool outside = d2 > r2;
    float inverse_d = 1.0f / sqrt_f(max_f(d2, 1e-35f));
    // Half angle that the ball around the box fills.
    float sin2_u = r2 * inverse_d * inverse_d;
    sin2_u = outside ? sin2_u : 1.0f;
    float sin_u = sqrt_f(sin2_u);
    float cos_u = sqrt_f(max_f(1.0f - sin2_u, 0.0f));

    // Receiving side: the smallest and the largest angle between the normal and anything in the ball.
    float facing = (q.n.x * dx + q.n.y * dy + q.n.z * dz);
    float reach_up = abs_f(q.n.x) * hx + abs_f(q.n.y) * hy + abs_f(q.n.z) * hz;
    float cos_i = facing * inverse_d;
    cos_i = q.transmits ? abs_f(cos_i) : cos_i;
    float sin_i = sqrt_f(max_f(1.0f - cos_i * cos_i, 0.0f));
    float best_i = cos_i * cos_u + sin_i * sin_u;
    float worst_i = cos_i * cos_u - sin_i * sin_u;
    best_i = (cos_i >= cos_u || !outside) ? 1.0f : best_i;
    worst_i = outside ? max_f(worst_i, 0.0f) : 0.0f;
    float receive = 0.5f * (max_f(best_i, 0.02f) + worst_i);
    bool above = facing + reach_up > -1e-5f * (abs_f(facing) + reach_up) || q.transmits;
    receive = above ? receive : 0.0f;
    receive = q.volume ? 1.0f : receive;

    // Sending side: the smallest angle between any normal and the direction to any place the point is seen from.
    float cos_e = -(node.axis_x[i] * dx + node.axis_y[i] * dy + node.axis_z[i] * dz) * inverse_d;
    cos_e = node.two_sided[i] > 0.0f ? abs_f(cos_e) : cos_e;
    float sin_e = sqrt_f(max_f(1.0f - cos_e * cos_e, 0.0f));
    float near_cos = cos_e * cos_u + sin_e * sin_u;
    float near_sin = sin_e * cos_u - cos_e * sin_u;
    bool within = cos_e >= cos_u || !outside;
    near_cos = within ? 1.0f : near_cos;
    near_sin = within ? 0.0f : max_f(near_sin, 0.0f);
    float send = near_cos * node.cos_normals[i] + near_sin * node.sin_normals[i];
    send = near_cos >= node.cos_normals[i] ? 1.0f : send;
    send = max_f(send, 0.02f);
    bool seen = near_cos > node.cos_reach[i] - 1e-4f;
    send = seen ? send : 0.0f;

    // Within the ball an emitter may be anywhere: its mean share is that of some radius, not of the centre.
    return node.intensity[i] * receive * send / max_f(max_f(d2, 0.25f * r2), 1e-20f);
}

// Importance of every child; returns their sum.
LUCH_FN float node_importances(const LightTreeNode& node, const LightQuery& q, float* importance) {
    for (int i = 0; i < LIGHT_WIDTH; ++i) importance[i] = child_importance(node, i, q);
    float sum = 0.0f;
    for (int i = 0; i < LIGHT_WIDTH; ++i) sum += importance[i];
    return sum;
}

// Picks a child in proportion; *u becomes a fresh number in [0, 1). sum > 0.
LUCH_FN int choose_child(const float* importance, float sum, float* u) {
    float target = *u * sum;
    int chosen = -1;
    float before = 0.0f, running = 0.0f;
    for (int i = 0; i < LIGHT_WIDTH; ++i) {
        if (importance[i] > 0.0f && (chosen < 0 || running <= target)) {
            chosen = i;
            before = running;
        }
        running += importance[i];
    }
    *u = clamp_f((target - before) / importance[chosen], 0.0f, 0.99999994f);
    return chosen;
}

struct EmitterChoice {
    u32 emitter;  // NONE: nothing can be seen from here
    float probability;
};

// A uniform float has 24 bits, which a deep descent uses up; the rest of the way goes on hashed bits.
LUCH_FN float refresh_unit(float u, Vec2 other) {
    return unit_float(hash_u32(float_bits(u), float_bits(other.x), float_bits(other.y)));
}

// root_importance: of nodes[0], already computed, with its sum > 0.
LUCH_FN_SLOW EmitterChoice choose_emitter(const LightsView& lights, const LightQuery& q, const float* root_importance,
                                          float root_sum, float u, Vec2 other) {
    alignas(64) float importance[LIGHT_WIDTH];
    for (int i = 0; i < LIGHT_WIDTH; ++i) importance[i] = root_importance[i];
    float sum = root_sum, probability = 1.0f, original = u;
    u32 at = 0;
    for (int level = 0;; ++level) {
        if (!(sum > 0.0f && finite_f(sum))) return {NONE, 0.0f};
        int lane = choose_child(importance, sum, &u);
        probability *= importance[lane] / sum;
        u32 child = lights.nodes[at].child[lane];
        if (child & CHILD_IS_EMITTER) return {child & ~CHILD_IS_EMITTER, probability};
        if (level == 1) u = refresh_unit(original, other);
        at = child;
        sum = node_importances(lights.nodes[at], q, importance);
    }
}

// Probability that choose_emitter ends at this emitter: the same products, from the leaf up.
LUCH_FN_SLOW float emitter_probability(const LightsView& lights, const LightQuery& q, u32 emitter) {
    alignas(64) float importance[LIGHT_WIDTH];
    float probability = 1.0f;
    for (u32 slot = lights.emitters[emitter].slot; slot != NONE;) {
        const LightTreeNode& node = lights.nodes[slot / LIGHT_WIDTH];
        float sum = node_importances(node, q, importance);
        float own = importance[slot % LIGHT_WIDTH];
        if (!(own > 0.0f && finite_f(sum))) return 0.0f;
        probability *= own / sum;
        slot = node.parent_slot;
    }
    return probability;
}

}  // namespace luch
