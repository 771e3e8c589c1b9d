// Methods made alike: each is leased to one frame, or to one sequence, at a time.
#pragma once

#include "ao/frame.h"

#include <mutex>
#include <span>
#include <tbb/concurrent_queue.h>

namespace scanshade {

/// A pool without methods serves clouds that are computed from their points. Several walks may share one pool. It must
/// outlive its leases, and the methods must outlive it.
class MethodPool {
  public:
    explicit MethodPool(std::span<FrameAo* const> methods) : size_(methods.size()) {
        for (FrameAo* method : methods)
            free_.push(method);
    }
    MethodPool() : size_(0) {}
    explicit MethodPool(FrameAo& method) : size_(1) { free_.push(&method); }

    /// A method, until the lease ends.
    class Lease {
      public:
        explicit Lease(MethodPool& pool) : pool_(pool) { pool_.free_.pop(method_); }
        ~Lease() { pool_.free_.push(method_); }
        Lease(const Lease&) = delete;
        Lease& operator=(const Lease&) = delete;
        [[nodiscard]] FrameAo& operator*() const { return *method_; }
        [[nodiscard]] FrameAo* operator->() const { return method_; }

      private:
        MethodPool& pool_;
        FrameAo* method_ = nullptr;
    };

    /// Waits until one is free; for ever if there is none.
    [[nodiscard]] Lease lease() { return Lease(*this); }
    /// How many frames may be computed at once.
    [[nodiscard]] std::size_t size() const { return size_; }
    /// To be held by work that takes all cores and much memory.
    [[nodiscard]] std::mutex& alone() { return alone_; }

  private:
    std::size_t size_;
    std::mutex alone_;
    tbb::concurrent_bounded_queue<FrameAo*> free_;
};

} // namespace scanshade
