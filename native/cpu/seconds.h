// What the clock on the wall says.
#pragma once
#include <chrono>

namespace luch::cpu {

// Since some fixed moment.
inline double seconds_now() {
    using namespace std::chrono;
    return duration<double>(steady_clock::now().time_since_epoch()).count();
}

}  // namespace luch::cpu
