// Methods made alike, lent to one frame, or one sequence, at a time each.
#pragma once

#include "ao/method.h"

#include <mutex>
#include <span>
#include <tbb/concurrent_queue.h>

namespace scanshade {

/// Any number of walks may share one. Outlives its loans; the methods outlive it.
class Crew {
  public:
    explicit Crew(std::span<Method* const> methods) : size_(methods.size()) {
        for (Method* method : methods)
            free_.push(method);
    }
    explicit Crew(Method& method) : size_(1) { free_.push(&method); }

    /// A method, until the loan ends.
    class Loan {
      public:
        explicit Loan(Crew& crew) : crew_(crew) { crew_.free_.pop(method_); }
        ~Loan() { crew_.free_.push(method_); }
        Loan(const Loan&) = delete;
        Loan& operator=(const Loan&) = delete;
        [[nodiscard]] Method& operator*() const { return *method_; }
        [[nodiscard]] Method* operator->() const { return method_; }

      private:
        Crew& crew_;
        Method* method_ = nullptr;
    };

    /// Waits until one is free.
    [[nodiscard]] Loan lend() { return Loan(*this); }
    /// How many frames may be computed at once.
    [[nodiscard]] std::size_t size() const { return size_; }
    /// Held by what takes all cores and much memory by itself.
    [[nodiscard]] std::mutex& alone() { return alone_; }

  private:
    std::size_t size_;
    std::mutex alone_;
    tbb::concurrent_bounded_queue<Method*> free_;
};

} // namespace scanshade
