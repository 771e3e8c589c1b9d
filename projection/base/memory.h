// How much memory is left, and refusals before an allocation that cannot succeed: Linux grants more than it has, and
// then kills the process without a word.
#pragma once

#include <cstdint>
#include <exception>
#include <optional>
#include <string>

namespace scanshade {

/// Bytes that this process may still take: by the machine, by its control group (containers, Slurm), by its own limit.
[[nodiscard]] std::uint64_t free_memory();

/// The process's peak memory in MiB, as the kernel counts it; NaN without /proc.
[[nodiscard]] double peak_memory_mib();

/// Throws OutOfMemory, "`what` needs about 9.5 GiB of memory, 6.2 GiB are free", if that many bytes are not there.
void require_memory(std::uint64_t bytes, const std::string& what);

/// Gives back to the system what was freed, if the process has grown by more than a tenth and 16 MiB since the last
/// call that did. The allocator keeps freed memory, in an arena for each thread; main.cpp has it do so, since the next
/// frame's images then cost no new pages. But captures of many sizes leave holes that nothing fits any more. So this is
/// for between captures; any thread may call it.
void return_freed_memory();

/// The sentence for an exception that means a failed allocation; none for any other.
[[nodiscard]] std::optional<std::string> failed_allocation(const std::exception& failure);

} // namespace scanshade
