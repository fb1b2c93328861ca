#include "cpu/thread_pool.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace luch::cpu {
namespace {

// The worker index while a body runs on this thread, -1 outside.
thread_local int current_worker = -1;

unsigned available_processors() {
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof(set), &set) == 0) return std::max(1, CPU_COUNT(&set));
    return std::max(1u, std::thread::hardware_concurrency());
}

}  // namespace

struct ThreadPool::Shared {
    std::mutex callers;  // one job at a time
    std::mutex mutex;
    std::condition_variable start, finished;
    std::vector<std::thread> threads;
    u64 job = 0;          // counts jobs; a change wakes the workers
    bool open = false;     // the present job still takes workers
    unsigned running = 0;  // workers inside it
    bool stop = false;

    Chunk chunk = nullptr;
    void* context = nullptr;
    size_t count = 0, grain = 1;
    std::atomic<size_t> next{0};
    std::exception_ptr error;

    void work(unsigned worker, const ThreadPool& pool) {
        current_worker = static_cast<int>(worker);
        for (;;) {
            size_t begin = next.fetch_add(grain, std::memory_order_relaxed);
            if (begin >= count) break;
            try {
                pool.check_cancelled();
                chunk(context, begin, std::min(begin + grain, count), worker);
            } catch (...) {
                std::lock_guard lock(mutex);
                if (!error) error = std::current_exception();
                next.store(count, std::memory_order_relaxed);
            }
        }
        current_worker = -1;
    }

    void loop(unsigned worker, const ThreadPool& pool) {
        u64 seen = 0;
        for (;;) {
            {
                std::unique_lock lock(mutex);
                start.wait(lock, [&] { return stop || job != seen; });
                if (stop) return;
                seen = job;
                if (!open) continue;  // woken too late: the others have done it all
                ++running;
            }
            work(worker, pool);
            std::lock_guard lock(mutex);
            if (--running == 0) finished.notify_one();
        }
    }
};

ThreadPool::ThreadPool(unsigned threads)
    : shared_(std::make_unique<Shared>()), size_(threads ? threads : available_processors()) {
    for (unsigned worker = 1; worker < size_; ++worker)
        shared_->threads.emplace_back([this, worker] { shared_->loop(worker, *this); });
}

ThreadPool::~ThreadPool() {
    {
        std::lock_guard lock(shared_->mutex);
        shared_->stop = true;
    }
    shared_->start.notify_all();
    for (std::thread& thread : shared_->threads) thread.join();
}

void ThreadPool::run(size_t count, size_t grain, Chunk chunk, void* context) {
    if (count == 0) return;
    if (current_worker >= 0) {  // inside a body: this worker alone, chunk by chunk
        for (size_t begin = 0; begin < count; begin += grain) {
            check_cancelled();
            chunk(context, begin, std::min(begin + grain, count), static_cast<unsigned>(current_worker));
        }
        return;
    }
    Shared& s = *shared_;
    std::lock_guard one_caller(s.callers);
    s.chunk = chunk;
    s.context = context;
    s.count = count;
    s.grain = grain;
    s.next.store(0, std::memory_order_relaxed);
    s.error = nullptr;
    bool alone = s.threads.empty() || count <= grain;
    if (!alone) {
        std::lock_guard lock(s.mutex);
        s.open = true;
        ++s.job;
    }
    if (!alone) s.start.notify_all();
    s.work(0, *this);
    if (!alone) {
        std::unique_lock lock(s.mutex);
        s.open = false;
        s.finished.wait(lock, [&] { return s.running == 0; });
    }
    if (s.error) std::rethrow_exception(s.error);
}

}  // namespace luch::cpu
