// The trees of a mesh that changes its shape (luch/accel/moving.h).
#pragma once
#include <vector>

#include "cpu/accel/group.h"
#include "cpu/accel/tree2.h"
#include "cpu/device_image.h"
#include "luch/accel/moving.h"

namespace luch::cpu {

struct MovingTrees {
    std::vector<float> rows;
    std::vector<u32> segments;  // of hair
    std::vector<u8> flags;
    std::vector<Tree2> trees;   // one a piece of time
    std::vector<Bvh2> views;
    MovingGroup view{};

    u64 nodes() const;
    u64 bytes() const;
    u32 depth() const;
};

// Fills the group's moving, root, kept and dropped. Its one member is the mesh.
void build_moving_group(Group& group, const SceneView& scene, const std::vector<std::vector<u8>>& flags,
                        const AccelChoice& choice, ThreadPool& pool);

// What a scene's structures keep of its motion, for a view.
struct SceneMotion {
    std::vector<EntryMotion> entries;
    std::vector<TransformKey> keys;
    std::vector<Slide> slides;
    std::vector<MovingGroup> groups;
    TraceMotion view{};

    bool moves() const { return !entries.empty(); }
    // GroupEntry::motion of an instance; deformed: its group's number where that changes its shape, else NONE.
    u32 add(const SceneView& scene, u32 instance, u32 deformed);
    // After the groups were built. Those that change their shape get numbers of their own.
    void finish(const std::vector<Group>& built);
    u64 bytes() const {
        return entries.size() * sizeof(EntryMotion) + keys.size() * sizeof(TransformKey) +
               slides.size() * sizeof(Slide);
    }
    // Everything behind the pointer, which lies in the image's block.
    void describe(DeviceImage& image, u32 block, const TraceMotion* const& pointer,
                  const std::vector<Group>& built) const;
};

// A box around all places of an instance that moves, where its own space holds `box`.
Box swept_box(const TransformKey* keys, u32 key_count, const Box& box);
// instances.h: the largest C on its way.
float swept_condition(const TransformKey* keys, u32 key_count);

}  // namespace luch::cpu
