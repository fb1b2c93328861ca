// A fixed set of worker threads and one verb, parallel_for. The cut into chunks depends on count and
// grain alone, never on the number of threads or on timing: a body that writes only what belongs to
// its own indices gives the same bits with any number of threads.
#pragma once
#include <atomic>
#include <cstddef>
#include <memory>
#include <type_traits>

#include "luch/platform.h"

namespace luch::cpu {

// Thrown out of work that its pool was told to give up.
struct Cancelled {};

class ThreadPool {
 public:
    // threads 0: as many as this process may run on. The calling thread counts as one of them.
    explicit ThreadPool(unsigned threads = 0);
    ~ThreadPool();
    ThreadPool(const ThreadPool&) = delete;
    ThreadPool& operator=(const ThreadPool&) = delete;

    unsigned size() const { return size_; }

    // From any thread: running and later parallel_fors end with Cancelled before their next chunk.
    void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
    // Forgets it; while nothing runs.
    void resume() { cancelled_.store(false, std::memory_order_relaxed); }
    // For long loops within a chunk.
    void check_cancelled() const {
        if (cancelled_.load(std::memory_order_relaxed)) throw Cancelled();
    }

    // Calls body(begin, end, worker) for the chunks [0, grain), [grain, 2 grain), ... of [0, count),
    // in any order, worker in [0, size()): an index for scratch memory. Returns when all are done.
    // The first exception thrown by a body is rethrown here (chunks not yet begun are then skipped).
    // A parallel_for inside a body runs its chunks in order on that worker.
    template <class Body>
    void parallel_for(size_t count, size_t grain, Body&& body) {
        using B = std::remove_reference_t<Body>;
        run(
            count, grain ? grain : 1,
            [](void* context, size_t begin, size_t end, unsigned worker) {
                (*static_cast<B*>(context))(begin, end, worker);
            },
            const_cast<void*>(static_cast<const void*>(&body)));
    }

 private:
    using Chunk = void (*)(void* context, size_t begin, size_t end, unsigned worker);
    void run(size_t count, size_t grain, Chunk chunk, void* context);

    struct Shared;
    std::unique_ptr<Shared> shared_;
    unsigned size_;
    std::atomic<bool> cancelled_{false};
};

}  // namespace luch::cpu
