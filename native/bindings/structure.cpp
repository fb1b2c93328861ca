// The structures of the race over arrays: one space, no instances. Shapes are checked in Python (luch/accel.py).
#include "cpu/accel/structure.h"

#include <pybind11/numpy.h>

#include <algorithm>
#include <cstring>
#include <mutex>
#include <vector>

#include "bindings/bind.h"
#include "bindings/counts.h"
#include "cpu/accel/copies.h"

namespace luch::bindings {
namespace {

using FloatArray = py::array_t<float, py::array::c_style>;
using IndexArray = py::array_t<u32, py::array::c_style>;
using ByteArray = py::array_t<u8, py::array::c_style>;

constexpr size_t RAYS_PER_CHUNK = 4096;
constexpr float LARGEST = 3.402823466e+38f;

class ArrayStructure {
 public:
    // positions (V, 3), triangles (T, 3), spheres (S, 4); flags: (T + S,) PrimitiveFlag, or none.
    ArrayStructure(const FloatArray& positions, const IndexArray& triangles, const FloatArray& spheres,
                   const ByteArray& flags, u32 kind, u32 quality, unsigned threads)
        : pool_(threads) {
        u32 triangle_count = u32(triangles.shape(0)), sphere_count = u32(spheres.shape(0));
        const float *p = positions.data(), *s = spheres.data();
        const u32* index = triangles.data();
        u32 vertex_count = u32(positions.shape(0));
        flags_.assign(flags.data(), flags.data() + flags.size());
        py::gil_scoped_release release;
        corners_.resize(9 * size_t(triangle_count));
        spheres_.assign(s, s + 4 * size_t(sphere_count));
        for (u32 t = 0; t < triangle_count; ++t)
            if (gather(p, vertex_count, index + 3 * size_t(t), corners_.data() + 9 * size_t(t))) refs_.push_back(t);
        for (u32 k = 0; k < sphere_count; ++k)
            if (sphere_can_be_traced({vec3_of(s + 4 * size_t(k)), s[4 * size_t(k) + 3]}))
                refs_.push_back(triangle_count + k);
        dropped_ = triangle_count + sphere_count - refs_.size();
        leave_out_copies_of_each(triangle_count);
        Primitives all = {corners_.data(), spheres_.data(), flags_.empty() ? nullptr : flags_.data(),
                          triangle_count,  sphere_count,    {}};
        structure_ = cpu::build_structure(cpu::StructureKind(kind),
                                          {all, refs_.data(), u32(refs_.size()), cpu::BuildQuality(quality)}, pool_);
    }

    // rays (N, 8) -> t, prim, u, v; and, if counted, nodes, boxes, primitives, bytes of all rays together.
    py::tuple closest(const FloatArray& rays, u32 precision, bool counted) {
        py::ssize_t count = rays.shape(0);
        FloatArray t(count), u(count), v(count);
        py::array_t<i32> prim(count);
        float *t_out = t.mutable_data(), *u_out = u.mutable_data(), *v_out = v.mutable_data();
        i32* prim_out = prim.mutable_data();
        Counters total;
        trace(
            rays, counted, &total,
            [&](size_t first, std::vector<Ray>& valid, std::vector<u32>& at, Counters* kept) {
                std::vector<RefHit> hits(valid.size());
                for (size_t i = 0; i < valid.size(); ++i) hits[i] = {valid[i].t_max, NONE, 0.0f, 0.0f};
                structure_->closest(Precision(precision), valid.data(), hits.data(), valid.size(), kept);
                for (size_t i = 0; i < valid.size(); ++i) {
                    size_t to = first + at[i];
                    bool hit = hits[i].ref != NONE;
                    t_out[to] = hit ? hits[i].t : INFINITE_DISTANCE;
                    prim_out[to] = i32(hits[i].ref);
                    u_out[to] = hits[i].u;
                    v_out[to] = hits[i].v;
                }
            },
            [&](size_t i) {
                t_out[i] = INFINITE_DISTANCE;
                prim_out[i] = -1;
                u_out[i] = v_out[i] = 0.0f;
            });
        return py::make_tuple(t, prim, u, v, counts(total));
    }

    // rays (N, 8) -> Blocked values, and counts as above.
    py::tuple any(const FloatArray& rays, u32 precision, bool counted) {
        py::array_t<u8> blocked(rays.shape(0));
        u8* out = blocked.mutable_data();
        Counters total;
        trace(
            rays, counted, &total,
            [&](size_t first, std::vector<Ray>& valid, std::vector<u32>& at, Counters* kept) {
                std::vector<u8> found(valid.size());
                structure_->any(Precision(precision), valid.data(), found.data(), valid.size(), kept);
                for (size_t i = 0; i < valid.size(); ++i) out[first + at[i]] = found[i];
            },
            [&](size_t i) { out[i] = BLOCKED_NOT; });
        return py::make_tuple(blocked, counts(total));
    }

    py::dict stats() const {
        cpu::StructureStats s = structure_->stats();
        py::dict out;
        out["primitives"] = refs_.size();
        out["dropped"] = dropped_;
        out["duplicate_primitives"] = copies_;
        out["nodes"] = s.nodes;
        out["references"] = s.references;
        out["depth"] = s.depth;
        out["bytes"] = s.bytes;
        out["primitive_bytes"] = (corners_.size() + spheres_.size()) * sizeof(float) + flags_.size();
        return out;
    }

    // For a device: the view's bytes, and of each array its name, its pointer's offset in the view, its bytes.
    py::tuple device_arrays() const {
        size_t bytes = 0;
        const void* view = structure_->view(&bytes);
        py::list arrays;
        for (const cpu::StructureArray& a : structure_->arrays())
            arrays.append(py::make_tuple(a.name, a.view_offset, py::bytes(static_cast<const char*>(a.data), a.bytes)));
        return py::make_tuple(py::bytes(static_cast<const char*>(view), bytes), arrays);
    }

 private:
    void leave_out_copies_of_each(u32 triangle_count) {
        auto numbers = [&](u32 ref, u32* count) {
            *count = ref < triangle_count ? 9 : 4;
            return ref < triangle_count ? corners_.data() + 9 * size_t(ref)
                                        : spheres_.data() + 4 * size_t(ref - triangle_count);
        };
        auto hash = [&](u32 ref) {
            u32 count;
            const float* own = numbers(ref, &count);
            return cpu::hash_of_floats(own, count);
        };
        auto same = [&](u32 a, u32 b) {
            u32 of_a, of_b;
            const float *x = numbers(a, &of_a), *y = numbers(b, &of_b);
            return of_a == of_b && std::memcmp(x, y, of_a * sizeof(float)) == 0 &&
                   (flags_.empty() || flags_[a] == flags_[b]);
        };
        cpu::CopySearch search;
        size_t all = refs_.size();
        std::erase_if(refs_, [&](u32 ref) { return search.seen(hash(ref), ref, same); });
        if (all - refs_.size() > refs_.size())
            refs_.resize(cpu::leave_out_copies(refs_.data(), refs_.size(), hash, same, [](u32) {}));
        copies_ = all - refs_.size();
    }

    static bool gather(const float* positions, u32 vertex_count, const u32* index, float* corners) {
        for (int k = 0; k < 3; ++k) {
            if (index[k] >= vertex_count) return false;
            std::copy_n(positions + 3 * size_t(index[k]), 3, corners + 3 * k);
        }
        return triangle_can_be_traced(vec3_of(corners), vec3_of(corners + 3), vec3_of(corners + 6));
    }
    template <class Run, class Miss>
    void trace(const FloatArray& rays, bool counted, Counters* total, Run&& run, Miss&& miss) {
        const Ray* in = reinterpret_cast<const Ray*>(rays.data());
        size_t count = size_t(rays.shape(0));
        std::mutex lock;
        py::gil_scoped_release release;
        pool_.parallel_for(count, RAYS_PER_CHUNK, [&](size_t begin, size_t end, unsigned) {
            std::vector<Ray> valid;
            std::vector<u32> at;
            for (size_t i = begin; i < end; ++i) {
                if (!ray_is_valid(in[i])) {
                    miss(i);
                    continue;
                }
                valid.push_back({in[i].origin, max_f(in[i].t_min, 0.0f), in[i].direction, min_f(in[i].t_max, LARGEST)});
                at.push_back(u32(i - begin));
            }
            Counters kept;
            run(begin, valid, at, counted ? &kept : nullptr);
            std::lock_guard guard(lock);
            total->add(kept);
        });
    }

    cpu::ThreadPool pool_;
    std::vector<float> corners_, spheres_;
    std::vector<u8> flags_;
    std::vector<u32> refs_;
    u64 dropped_ = 0, copies_ = 0;
    std::unique_ptr<cpu::Structure> structure_;
};

}  // namespace

void bind_structure(py::module_& m) {
    py::class_<ArrayStructure>(m, "ArrayStructure")
        .def(py::init<const FloatArray&, const IndexArray&, const FloatArray&, const ByteArray&, u32, u32, unsigned>())
        .def("closest", &ArrayStructure::closest)
        .def("any", &ArrayStructure::any)
        .def("stats", &ArrayStructure::stats)
        .def("device_arrays", &ArrayStructure::device_arrays);
}

}  // namespace luch::bindings
