// Where one worker's time goes, pixel by pixel, for the Render Time pass alone.
#pragma once
#include <chrono>

#include "luch/film/film.h"

namespace luch::cpu {

// Rays that are traced between two looks at the clock, which takes 25 ns: the fewer, the nearer to their own pixels.
inline constexpr int TIMED_RAYS = 8;

class PixelClock {
 public:
    void start() { last_ = std::chrono::steady_clock::now(); }

    // The time since the last call, in equal parts to `count` pixels, pixel(0) to pixel(count - 1). Where there are
    // none it stays for the next.
    template <class Pixel>
    void charge(FilmWriter& writer, int count, const Pixel& pixel) {
        if (count == 0) return;
        const auto now = std::chrono::steady_clock::now();
        const double part = std::chrono::duration<double, std::milli>(now - last_).count() / count;
        for (int i = 0; i < count; i++) film_row(writer.film, pixel(i))[writer.film.layout.time] += part;
        last_ = now;
    }

 private:
    std::chrono::steady_clock::time_point last_;
};

}  // namespace luch::cpu
