// Walks under surfaces, and the surfaces where they come out.
#include "cpu/accel/local_trees.h"
#include "cpu/integrator/batch.h"
#include "cpu/integrator/scratch.h"
#include "luch/integrator/subsurface_disk.h"

namespace luch::cpu {
namespace {

struct LocalTracer {
    const LocalTrees& trees;
    float time;  // of the walk
    Hit closest(u32 instance, const Ray& ray) const { return trees.closest(instance, ray, time); }
};

}  // namespace

bool Batch::enters_subsurface(u32 k, int lane, const ClosureSet& set, const SurfacePoint& spawn, Vec3 u) {
    int lobe = chosen_subsurface(set, u.z);
    if (lobe < 0) return false;
    SubsurfaceWalk* walk = &walks_[size_t(walk_count_)];
    if (enter_subsurface(paths_[ray_path_[k]], scratch_->points, lane, set, lobe, spawn, {u.x, u.y}, k, walk))
        walk_count_++;
    return true;
}

// All walks of this generation; then, material by material, what comes out is lit and goes on.
void Batch::walk_subsurface() {
    LocalTracer tracer{*scene_.walk_trees, SHUTTER_MIDDLE};
    counts_.subsurface_walks += u64(walk_count_);
    int exits = 0;
    for (int i = 0; i < walk_count_ && !stops(); i++) {
        tracer.time = time_of(walks_[size_t(i)].ray);
        pass_inside(scene_.view, walks_[size_t(i)], tracer, &counts_.subsurface_steps);
        charge_queue(&walks_[size_t(i)].ray, 1);
        if (walks_[size_t(i)].hit.instance == NONE) continue;
        if (exits != i) walks_[size_t(exits)] = walks_[size_t(i)];
        exits++;
    }
    walk_count_ = exits;
    u32 chunk[SHADE_LANES];
    u32 materials = scene_.view.material_count;
    for (u32 m = 0; m < materials; m++) {
        int count = 0;
        for (int i = 0; i < exits; i++) {
            const Hit& hit = walks_[size_t(i)].hit;
            if (materials > 1 && material_at(scene_.view, hit.instance, hit.prim) != m) continue;
            chunk[count++] = u32(i);
            if (count == SHADE_LANES) {
                shade_exits(m, chunk, count);
                count = 0;
            }
        }
        if (count > 0) shade_exits(m, chunk, count);
    }
}

// queue: walks that come out at surfaces of one material.
void Batch::shade_exits(u32 material_index, const u32* queue, int count) {
    const Program& program = scene_.view.materials[material_index].program;
    ShadePoints& points = scratch_->points;
    ClosureSet* sets = scratch_->sets;
    u32 rays[SHADE_LANES];
    points.count = count;
    for (int lane = 0; lane < count; lane++) {
        const SubsurfaceWalk& walk = walks_[queue[lane]];
        PathState& path = paths_[ray_path_[walk.ray]];
        path.throughput = walk.throughput;
        rays[lane] = walk.ray;
        scratch_->lit_lanes[lane] = lane;
        SurfacePoint& spawn = scratch_->spawn[lane];
        float time = time_of(walk.ray);
        spawn = exit_point(scene_, walk, time);
        setup_surface_lane(scene_.view, exit_inputs(path, ray_path_[walk.ray], walk, spawn, time), points, lane);
    }
    bool bent = program.flags & PROGRAM_SUBSURFACE_BUMP;
    if (bent) run_program(scene_.view, program, points, sets, registers_.data());
    for (int lane = 0; lane < count; lane++) {
        Vec3 normal = lane_normal(points, lane);
        setup_exit(sets[lane], points, lane, bent ? exit_normal(sets[lane], normal) : normal);
    }
    draw_numbers(rays, count);
    if (scene_.has_lights) sample_lights(rays, count);
    gather(rays, count);
    const auto& u = scratch_->scatter_u;
    for (int lane = 0; lane < count; lane++) {
        u32 path = ray_path_[rays[lane]];
        next_path_[next_count_] = path;
        if (scatter(scene_, writer_, paths_[path], points, lane, sets[lane], scratch_->spawn[lane],
                    {u[0][lane], u[1][lane], u[2][lane]}, -walks_[queue[lane]].direction, 0.0f,
                    &next_rays_[next_count_]))
            send_next(points, lane);
    }
    charge_queue(rays, count);
}

}  // namespace luch::cpu
