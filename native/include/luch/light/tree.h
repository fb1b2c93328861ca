// The light tree: which emitter to sample, from where the shaded point stands. Sixteen children a node, so that a
// thousand lamps are three steps and every step is one vector operation over the children; a finer choice per step
// also strays less from the true shares than sixteen halvings through coarse bounds.
// Bounds of position and direction: Conty Estevez and Kulla 2018, "Importance sampling of many lights with adaptive
// tree splitting".
#pragma once
#include "luch/light/light.h"
#include "luch/math/bounds.h"
#include "luch/sampling/hash.h"

namespace luch {

inline constexpr int LIGHT_WIDTH = 16;
inline constexpr u32 CHILD_IS_EMITTER = 0x80000000u;

// Every child, node or single emitter alike: a box, a cone of normals, an intensity.
struct alignas(64) LightTreeNode {
    float center_x[LIGHT_WIDTH], center_y[LIGHT_WIDTH], center_z[LIGHT_WIDTH];
    float half_x[LIGHT_WIDTH], half_y[LIGHT_WIDTH], half_z[LIGHT_WIDTH];  // of the box
    float mean_x[LIGHT_WIDTH], mean_y[LIGHT_WIDTH], mean_z[LIGHT_WIDTH];  // normal, mean by intensity: at most unit
    float spread[LIGHT_WIDTH];        // 1 - |mean|^2: 0 where all normals agree
    float omni[LIGHT_WIDTH];          // share of the intensity that leaves in all directions alike
    float axis_x[LIGHT_WIDTH], axis_y[LIGHT_WIDTH], axis_z[LIGHT_WIDTH];  // of the cone that holds all normals
    float cos_reach[LIGHT_WIDTH];     // of the cone that holds all light; -2: everywhere
    float fold[LIGHT_WIDTH];          // -1: light leaves along -normal too; 1: it does not
    float intensity[LIGHT_WIDTH];     // W/sr along the axis, all emitters together; 0: no child
    u32 child[LIGHT_WIDTH];           // node, or emitter | CHILD_IS_EMITTER
    u32 parent_slot;                  // LIGHT_WIDTH * node + lane above; NONE: the root
    u32 count;                        // children
};

struct Emitter {
    u32 lamp;            // NONE: a triangle
    u32 instance, prim;  // prim NONE: a cluster, the whole instance
    u32 slot;            // LIGHT_WIDTH * node + lane where it hangs
};

// Where light is wanted, with its two switches also as numbers, so that the loop over children has no branch.
struct LightQuery {
    Vec3 p, n;
    bool transmits, volume;
    float fold;            // -1: light from behind n counts as much; 1: it does not count
    float always_above;    // huge: nothing lies behind
    float least_received;  // 1: no normal
};

LUCH_FN LightQuery make_light_query(Vec3 p, Vec3 n, bool transmits) {
    bool volume = is_zero(n);
    return {
        p, n, transmits, volume, transmits ? -1.0f : 1.0f, transmits || volume ? 1e30f : 0.0f, volume ? 1.0f : 0.0f};
}

// Irradiance that one child may give, roughly; 0 only if it gives none. Slack keeps rounding from cutting off light.
LUCH_FN float child_importance(const LightTreeNode& node, int i, const LightQuery& q) {
    float dx = node.center_x[i] - q.p.x, dy = node.center_y[i] - q.p.y, dz = node.center_z[i] - q.p.z;
    float hx = node.half_x[i], hy = node.half_y[i], hz = node.half_z[i];
    float d2 = max_f(dx * dx + dy * dy + dz * dz, 1e-35f), r2 = hx * hx + hy * hy + hz * hz;
    float inverse_d = 1.0f / sqrt_f(d2);
    // Half angle that the ball around the box fills. From inside the ball: everything, as sine 1 and cosine -1.
    float sin_u = sqrt_f(min_f(r2 * inverse_d * inverse_d, 1.0f));
    float cos_u = sqrt_f(max_f(1.0f - sin_u * sin_u, 0.0f));
    cos_u = d2 > r2 ? cos_u : -1.0f;

    // Receiving side: between the smallest and the largest angle of the normal with anything in the ball. Cosines by
    // adding angles.
    float facing = q.n.x * dx + q.n.y * dy + q.n.z * dz;
    float reach_up = abs_f(q.n.x) * hx + abs_f(q.n.y) * hy + abs_f(q.n.z) * hz;
    float cos_i = facing * inverse_d;
    cos_i = max_f(cos_i, q.fold * cos_i);
    float sin_i = sqrt_f(max_f(1.0f - cos_i * cos_i, 0.0f));
    float best_i = cos_i * cos_u + sin_i * sin_u;
    best_i = cos_i >= cos_u ? 1.0f : best_i;
    float worst_i = d2 > r2 ? cos_i * cos_u - sin_i * sin_u : 0.0f;
    float receive = 0.5f * (max_f(best_i, LIGHT_LEAST_COSINE) + max_f(worst_i, 0.0f));
    float above = facing + reach_up + q.always_above + LIGHT_FACING_SLACK * (abs_f(facing) + reach_up);
    receive = above > 0.0f ? max_f(receive, q.least_received) : 0.0f;

    // Sending side: nothing if the smallest angle between any normal and any direction to the point is beyond reach.
    float cos_e = -(node.axis_x[i] * dx + node.axis_y[i] * dy + node.axis_z[i] * dz) * inverse_d;
    cos_e = max_f(cos_e, node.fold[i] * cos_e);
    float sin_e = sqrt_f(max_f(1.0f - cos_e * cos_e, 0.0f));
    float near_cos = cos_e * cos_u + sin_e * sin_u;
    near_cos = cos_e >= cos_u ? 1.0f : near_cos;
    // Else the mean of max(0, cos): of directions whose cosine has mean cos_m and about this variance (what a whole
    // sphere of normals has, 1/4 in the root, scaled by their spread and by the ball's width). Bounds alone give
    // an emitter's silhouette as much as its middle: relative variance 0.45 against 0.02 on a ball of triangles.
    float cos_m = -(node.mean_x[i] * dx + node.mean_y[i] * dy + node.mean_z[i] * dz) * inverse_d * max_f(cos_u, 0.0f);
    float root = sqrt_f(cos_m * cos_m + 0.25f * (node.spread[i] + sin_u * sin_u) + LIGHT_LEAST_VARIANCE);
    float send = 0.5f * (root + max_f(cos_m, -node.fold[i] * root));
    send = mix_f(send, 1.0f, node.omni[i]);
    send = near_cos > node.cos_reach[i] - LIGHT_REACH_SLACK ? send : 0.0f;

    // Within the ball an emitter may be anywhere: its mean share is that of some radius, not of the centre.
    return node.intensity[i] * receive * send / max_f(max_f(d2, 0.25f * r2), 1e-20f);
}

// Importance of every child; returns their sum.
LUCH_FN_APART float node_importances(const LightTreeNode& node, const LightQuery& query, float* importance) {
    const LightQuery q = query;
    alignas(64) float result[LIGHT_WIDTH];
    for (int i = 0; i < LIGHT_WIDTH; ++i) result[i] = child_importance(node, i, q);
    for (int i = 0; i < LIGHT_WIDTH; ++i) importance[i] = result[i];
    // Pairwise: a chain of sixteen additions would wait for each other.
    for (int i = 0; i < 8; ++i) result[i] += result[i + 8];
    for (int i = 0; i < 4; ++i) result[i] += result[i + 4];
    return (result[0] + result[2]) + (result[1] + result[3]);
}

// Picks a child in proportion; *u becomes a fresh number in [0, 1). sum > 0.
LUCH_FN int choose_child(const float* importance, float sum, float* u) {
    float target = *u * sum, before = 0.0f, running = 0.0f;
    int chosen = 0;
    for (int i = 0; i < LIGHT_WIDTH; ++i) {
        if (!(importance[i] > 0.0f)) continue;
        chosen = i;  // the last one takes what rounding leaves over
        before = running;
        running += importance[i];
        if (target < running) break;
    }
    *u = clamp_f((target - before) / importance[chosen], 0.0f, BELOW_ONE);
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

// A number for the choice within a cluster, apart from the one above.
LUCH_FN float cluster_unit(float u, Vec2 other) {
    return unit_float(hash_u32(float_bits(u) ^ 0x9e3779b9u, float_bits(other.y), float_bits(other.x)));
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
