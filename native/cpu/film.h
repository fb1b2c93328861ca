// Owns the film's memory and reads passes out of it.
#pragma once
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "cpu/thread_pool.h"
#include "luch/film/read.h"

namespace luch::cpu {

// Fields as in luch.scene.Film.
struct FilmSpec {
    u32 width = 0, height = 0;  // of the rendered region: the frame, or its border
    u32 x0 = 0, y0 = 0;         // bottom left corner of the region in the frame
    double origin[3] = {0, 0, 0};
    float exposure = 1.0f;
    std::vector<std::string> passes;
    u32 cryptomatte_depth = 6;
    std::vector<std::string> lightgroups;
    struct Aov {
        std::string name;
        bool color;
    };
    std::vector<Aov> aovs;
    bool marks = false;  // keep what the samples before powers of two added, for estimates of the error
};

struct Pass {
    std::string name;  // Blender's
    PassSource from;
};

class Film {
 public:
    // Throws std::invalid_argument that names a pass which is not known or a size that cannot be.
    explicit Film(const FilmSpec& spec);

    FilmView view();
    const std::vector<Pass>& passes() const { return passes_; }  // Combined first
    u32 width() const { return spec_.width; }
    u32 height() const { return spec_.height; }
    double exposure() const { return spec_.exposure; }
    // Bytes of one pixel: its row of sums and its sample count.
    u64 pixel_bytes() const { return u64(layout_.stride) * sizeof(FilmSum) + sizeof(u32); }

    // Writes every pass: out[i] holds height * width * passes()[i].from.channels floats, bottom row first. Pixels
    // without samples are 0.
    void resolve(const std::vector<float*>& out, ThreadPool& pool) const;

    // Combined without alpha and one draw of its error, from the difference of the samples before and after a mark:
    // both height * width * 3 floats, bottom row first. Were samples independent, the square of a deviation would have
    // the expectation of the mean's squared error; parts of one sequence differ by more, which luch.accuracy takes
    // out. NaN where a part has no samples. Returns the share of the samples that lie before the mark, 0 where no
    // pixel has both parts. Throws std::logic_error for a film without marks.
    double deviations(float* mean, float* deviation, ThreadPool& pool) const;

    // Adds what another film of the same layout holds, e.g. other samples of the same picture. What the
    // first sample sees is kept where this film has samples.
    void merge(const Film& other);

 private:
    FilmSpec spec_;
    FilmLayout layout_;
    std::vector<Pass> passes_;
    // From calloc: pages are zeroed when a worker first touches them, not all at once by one thread.
    std::unique_ptr<FilmSum[], void (*)(void*)> rows_{nullptr, std::free};
    std::vector<u32> counts_;
};

}  // namespace luch::cpu
