#include "projection/base/memory.h"

#include "projection/base/error.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <limits>
#include <malloc.h>
#include <new>
#include <opencv2/core.hpp>
#include <sys/resource.h>
#include <system_error>
#include <unistd.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t unlimited = std::numeric_limits<std::uint64_t>::max();

/// A number of bytes in a file by itself; none for "max" and where there is no such file.
std::optional<std::uint64_t> bytes_in(const fs::path& file) {
    std::ifstream stream(file);
    std::uint64_t bytes = 0;
    if (stream >> bytes)
        return bytes;
    return std::nullopt;
}

/// The number behind a word in a file of many.
std::optional<std::uint64_t> number_behind(const std::string& wanted, const fs::path& file) {
    std::ifstream stream(file);
    for (std::string word; stream >> word;)
        if (std::uint64_t number = 0; word == wanted && stream >> number)
            return number;
    return std::nullopt;
}

std::uint64_t left_of(std::uint64_t limit, std::uint64_t used) { return limit - std::min(limit, used); }

/// Names of the files in which a version of control groups keeps its numbers.
struct GroupFiles {
    fs::path root;
    const char *limit, *used, *cache; ///< cache: a word in memory.stat
};
const GroupFiles version_1{"/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes",
                           "total_inactive_file"};
const GroupFiles version_2{"/sys/fs/cgroup", "memory.max", "memory.current", "inactive_file"};

/// Left of a control group and of those around it. Its cache of files gives way.
std::uint64_t left_of_groups(const GroupFiles& files, const std::string& path) {
    std::uint64_t left = unlimited;
    // In a container the path may be the host's, and the root the container's own group.
    for (fs::path group = files.root / fs::path(path).relative_path();; group = group.parent_path()) {
        const auto limit = bytes_in(group / files.limit), used = bytes_in(group / files.used);
        if (limit && used) {
            const std::uint64_t cache = number_behind(files.cache, group / "memory.stat").value_or(0);
            left = std::min(left, left_of(*limit, left_of(*used, cache)));
        }
        if (group == files.root || !group.has_relative_path())
            return left;
    }
}

/// Of the groups that the process is in: lines "0::/path" (version 2) and "4:memory:/path" (version 1).
std::uint64_t left_of_own_groups() {
    std::uint64_t left = unlimited;
    std::ifstream stream("/proc/self/cgroup");
    for (std::string line; std::getline(stream, line);) {
        const auto first = line.find(':'), second = line.find(':', first + 1);
        if (second == std::string::npos)
            continue;
        const std::string kinds = line.substr(first + 1, second - first - 1), path = line.substr(second + 1);
        if (kinds.empty())
            left = std::min(left, left_of_groups(version_2, path));
        else if (("," + kinds + ",").find(",memory,") != std::string::npos)
            left = std::min(left, left_of_groups(version_1, path));
    }
    return left;
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
    return std::min({machine_kib ? *machine_kib * 1024 : unlimited, left_of_own_limit(), left_of_own_groups()});
}

double peak_memory_mib() {
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;)
        if (double kib = 0; word == "VmHWM:" && status >> kib)
            return kib / 1024;
    return std::numeric_limits<double>::quiet_NaN();
}

void return_freed_memory() {
    static std::atomic<std::uint64_t> after_last = 0;
    const std::uint64_t before = after_last;
    if (pages_of_process(true) < before + before / 10 + (std::uint64_t(16) << 20))
        return;
    ::malloc_trim(0);
    after_last = pages_of_process(true);
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
