// Writing without half files: temporary name, sync, rename.
#include "io/output_file.h"

#include "io/text.h"
#include "projection/error.h"

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <fmt/format.h>
#include <memory>
#include <optional>
#include <system_error>
#include <unistd.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

fs::path temporary_name(const fs::path& target) {
    static std::atomic<unsigned> count = 0;
    const auto name =
        fmt::format(".{}.tmp-{}-{}{}", target.stem().string(), ::getpid(), count++, target.extension().string());
    return target.parent_path() / name;
}

/// Syncs the file to disk before the rename makes it visible.
void sync(const fs::path& path, int flags) {
    const int handle = ::open(path.c_str(), flags | O_CLOEXEC);
    if (handle < 0)
        throw std::system_error(errno, std::generic_category(), "cannot be opened again");
    const int failed = ::fsync(handle) == 0 ? 0 : errno;
    ::close(handle);
    // EINVAL: a file system without fsync, which offers nothing better.
    if (failed != 0 && failed != EINVAL)
        throw std::system_error(failed, std::generic_category(), "cannot be synced");
}

void write_bytes(const fs::path& file, std::string_view bytes) {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(std::fopen(file.c_str(), "wb"), &std::fclose);
    if (!stream)
        throw std::system_error(errno, std::generic_category(), "cannot be created");
    const bool complete = std::fwrite(bytes.data(), 1, bytes.size(), stream.get()) == bytes.size();
    if (!complete || std::fflush(stream.get()) != 0)
        throw std::system_error(errno, std::generic_category(), "cannot be written");
}

/// The stem in a name that temporary_name() made; nothing for any other name.
std::optional<std::string_view> target_of(std::string_view name) {
    constexpr std::string_view mark = ".tmp-";
    const auto at = name.rfind(mark);
    if (!name.starts_with('.') || at == std::string_view::npos)
        return std::nullopt;
    const std::string_view numbers = name.substr(at + mark.size(), name.find('.', at + mark.size()) - at - mark.size());
    const auto dash = numbers.find('-');
    if (dash == std::string_view::npos || !whole_number(numbers.substr(0, dash)) ||
        !whole_number(numbers.substr(dash + 1)))
        return std::nullopt;
    return name.substr(1, at - 1);
}

} // namespace

void write_atomically(const fs::path& target, const std::function<void(const fs::path&)>& write) {
    const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
    const fs::path temporary = temporary_name(target);
    const auto clean_up = [&] {
        std::error_code ignored;
        fs::remove(temporary, ignored);
    };
    try {
        during(target.string(), [&] {
            try {
                fs::create_directories(folder);
                write(temporary);
                sync(temporary, O_RDONLY);
                fs::rename(temporary, target);
                sync(folder, O_RDONLY | O_DIRECTORY);
            } catch (const std::system_error& failure) { // the file system's answer; streams throw it, too
                throw Outage(std::string("not written: ") + failure.what());
            }
        });
    } catch (...) {
        clean_up();
        throw;
    }
}

void write_atomically(const fs::path& target, std::string_view bytes) {
    write_atomically(target, [&](const fs::path& temporary) { write_bytes(temporary, bytes); });
}

int remove_leftovers(const fs::path& folder, const std::function<bool(std::string_view)>& ours) {
    int removed = 0;
    std::error_code trouble;
    for (fs::directory_iterator entry(folder, trouble), end; !trouble && entry != end; entry.increment(trouble)) {
        const std::string name = entry->path().filename().string();
        const auto stem = target_of(name);
        if (!stem || !ours(*stem))
            continue;
        std::error_code ignored;
        if (entry->is_regular_file(ignored) && fs::remove(entry->path(), ignored))
            ++removed;
    }
    return removed;
}

} // namespace scanshade
