// Vectors that many threads fill: their memory is not written before.
#pragma once

#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace scanshade {

/// Leaves plain values without one when a vector grows. One thread would write all of them else, before many threads
/// write them again; and memory belongs to the processor that touches it first.
template <class T>
struct UntouchedAllocator : std::allocator<T> {
    template <class U>
    struct rebind {
        using other = UntouchedAllocator<U>;
    };
    template <class U>
    void construct(U* at) {
        ::new (static_cast<void*>(at)) U;
    }
    template <class U, class... Arguments>
    void construct(U* at, Arguments&&... arguments) {
        ::new (static_cast<void*>(at)) U(std::forward<Arguments>(arguments)...);
    }
};

/// `resize()` and `Untouched(size)` leave plain values as they are in memory: every one must be written before it is
/// read.
template <class T>
using Untouched = std::vector<T, UntouchedAllocator<T>>;

} // namespace scanshade
