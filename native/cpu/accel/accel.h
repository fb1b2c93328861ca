// The scene as rays see it: a structure per mesh, a top level over instances. Hits do not depend on the
// structure: the smallest t in (t_min, t_max]; on equal t the smaller (instance, prim).
#pragma once
#include <cstddef>
#include <memory>
#include <vector>

#include "cpu/accel/structure.h"
#include "cpu/thread_pool.h"
#include "luch/accel/primitives.h"
#include "luch/shade/scene_view.h"

namespace luch::cpu {

// Primitives of a mesh that no structure holds, by cause; instances that were taken to the world count one by one.
struct LeftOut {
    u32 mesh;
    u64 invalid = 0;  // a vertex is not finite or its index lies outside the mesh; a sphere is not finite
    u64 too_far = 0;  // beyond LARGEST_COORDINATE
    u64 empty = 0;    // no area, no size
    u64 copies = 0;   // the same corners as one that counts before them: no ray tells them apart
};
enum class LeftOutCause : u8 { NONE_, INVALID, TOO_FAR, EMPTY, COPY };

struct AccelStats {
    u64 triangles = 0;          // kept, counted once per mesh (once per instance where meshes are merged)
    u64 spheres = 0;            // kept, once per mesh
    u64 pieces = 0;             // of curves: kept, once per mesh
    u64 nodes = 0, leaf_blocks = 0;
    u64 bytes = 0;              // nodes, leaf blocks and tables
    u64 dropped_triangles = 0;  // a vertex is not finite, its index lies outside the mesh, or there is no area
    u64 dropped_spheres = 0;    // not finite, or of no size
    u64 dropped_pieces = 0;     // not finite, or of no radius
    u64 duplicates = 0;         // see LeftOut::copies
    std::vector<LeftOut> left_out;  // by mesh, those that lost something
    double build_seconds = 0.0;
};

// How a group of primitives is searched: by the eight-wide tree, or by one of the race's structures.
struct AccelChoice {
    bool wide = true;
    StructureKind kind = StructureKind::BRUTE_FORCE;  // unless wide
    BuildQuality quality = BuildQuality::NORMAL;
    Precision precision = Precision::WATERTIGHT;
    u64 leave_from = ~u64(0);  // triangles of a group that SceneTrees leaves to a device's builder
};

// Instances that share a mesh are taken to the world, a copy of the triangles each, while all such copies
// together stay below this: rays through one tree are about twice as fast as through two levels. 65 bytes and
// 0.4 microseconds of building a triangle.
constexpr u64 FLATTEN_TRIANGLES = 2'000'000;

class Accel {
 public:
    // flags: per mesh, per primitive PrimitiveFlag bits; empty, or an empty list: all opaque.
    // The scene's arrays are copied: the view may go away afterwards, the instances too.
    static std::unique_ptr<Accel> build(const SceneView& scene, const std::vector<std::vector<u8>>& flags,
                                        ThreadPool& pool, const AccelChoice& choice = {},
                                        u64 flatten_triangles = FLATTEN_TRIANGLES);
    virtual ~Accel() = default;

    // Ray i sees the instances whose visibility shares a bit with ray_kinds[i]; null: all of them.
    // A ray with a non-finite origin or direction, a zero direction or a NaN interval misses.
    // times: of each ray, 0 to 1 while the shutter is open; null: all in its middle. Unread where nothing moves.
    // counters null: none are kept, by code compiled without them; else the work of all rays is added to it.
    virtual void closest(const Ray* rays, const u32* ray_kinds, Hit* hits, size_t count, const float* times = nullptr,
                         Counters* counters = nullptr) const = 0;

    // blocked[i]: BLOCKED_OPAQUE if an opaque primitive lies in the interval, else BLOCKED_MAYBE if one that
    // may be transparent does (walk them with closest), else BLOCKED_NOT.
    virtual void any(const Ray* rays, const u32* ray_kinds, u8* blocked, size_t count, const float* times = nullptr,
                     Counters* counters = nullptr) const = 0;

    virtual AccelStats stats() const = 0;
};

}  // namespace luch::cpu
