#include "projection/memory.h"

#include "projection/error.h"

#include <algorithm>
#include <cerrno>
#include <fmt/format.h>
#include <fstream>
#include <limits>
#include <new>
#include <opencv2/core.hpp>
#include <sys/resource.h>
#include <system_error>
#include <unistd.h>

namespace scanshade {
namespace {

constexpr std::uint64_t unlimited = std::numeric_limits<std::uint64_t>::max();

/// A number of bytes in a file by itself; none for "max" and where there is no such file.
std::optional<std::uint64_t> bytes_in(const std::string& file) {
    std::ifstream stream(file);
    std::uint64_t bytes = 0;
    if (stream >> bytes)
        return bytes;
    return std::nullopt;
}

/// The number behind a word in a file of many.
std::optional<std::uint64_t> number_behind(const std::string& wanted, const std::string& file) {
    std::ifstream stream(file);
    for (std::string word; stream >> word;)
        if (std::uint64_t number = 0; word == wanted && stream >> number)
            return number;
    return std::nullopt;
}

std::uint64_t left_of(std::uint64_t limit, std::uint64_t used) { return limit - std::min(limit, used); }

/// Left of a control group; its cache of files gives way.
std::uint64_t left_of_group(const std::string& limit_file, const std::string& used_file, const std::string& statistics,
                            const std::string& cache) {
    const auto limit = bytes_in(limit_file), used = bytes_in(used_file);
    if (!limit || !used)
        return unlimited;
    return left_of(*limit, left_of(*used, number_behind(cache, statistics).value_or(0)));
}

/// Of the process: its addresses, and those resident.
std::uint64_t pages_of_process(bool resident) {
    std::ifstream stream("/proc/self/statm");
    std::uint64_t all = 0, in_memory = 0;
    stream >> all >> in_memory;
    return (resident ? in_memory : all) * static_cast<std::uint64_t>(::sysconf(_SC_PAGE_SIZE));
}

std::uint64_t left_of_own_limit() {
    rlimit limit = {};
    if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return unlimited;
    return left_of(limit.rlim_cur, pages_of_process(false));
}

double gib(std::uint64_t bytes) { return static_cast<double>(bytes) / (1 << 30); }

/// Whether a library's error code means that memory is short. Vulkan's: out of host or of device memory.
bool means_no_memory(const std::error_code& code) {
    if (std::string_view(code.category().name()) == "vk::Result")
        return code.value() == -1 || code.value() == -2;
    return code == std::errc::not_enough_memory;
}

} // namespace

std::uint64_t free_memory() {
    const auto machine_kib = number_behind("MemAvailable:", "/proc/meminfo");
    const std::string group = "/sys/fs/cgroup/";
    return std::min(
        {machine_kib ? *machine_kib * 1024 : unlimited, left_of_own_limit(),
         left_of_group(group + "memory.max", group + "memory.current", group + "memory.stat", "inactive_file"),
         left_of_group(group + "memory/memory.limit_in_bytes", group + "memory/memory.usage_in_bytes",
                       group + "memory/memory.stat", "total_inactive_file")});
}

void require_memory(std::uint64_t bytes, const std::string& what) {
    constexpr std::uint64_t always_there = 64 << 20; // asking the system costs more than most frames' images
    if (bytes < always_there)
        return;
    if (const std::uint64_t free = free_memory(); bytes > free)
        throw OutOfMemory(
            fmt::format("{} needs about {:.1f} GiB of memory, {:.1f} GiB are free", what, gib(bytes), gib(free)));
}

std::optional<std::string> failed_allocation(const std::exception& failure) {
    const auto* of_opencv = dynamic_cast<const cv::Exception*>(&failure);
    const auto* of_system = dynamic_cast<const std::system_error*>(&failure);
    const bool is = dynamic_cast<const std::bad_alloc*>(&failure) ||
                    (of_opencv && of_opencv->code == cv::Error::StsNoMem) ||
                    (of_system && means_no_memory(of_system->code()));
    if (!is)
        return std::nullopt;
    return fmt::format("not enough memory: needs more than the {:.1f} GiB in use, {:.1f} GiB are free",
                       gib(pages_of_process(true)), gib(free_memory()));
}

void throw_foreign(const std::string& what, const std::exception& failure) {
    if (const auto sentence = failed_allocation(failure))
        throw OutOfMemory(what + ": " + *sentence);
    std::throw_with_nested(InternalError(what + ": " + failure.what()));
}

} // namespace scanshade
