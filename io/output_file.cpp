// Writing without half files: temporary name, sync, rename.
#include "io/output_file.h"

#include "io/content_hash.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <fmt/format.h>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <system_error>
#include <unistd.h>
#include <vector>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t longest_name = 255; // bytes, on every common file system

fs::path temporary_name(const fs::path& target) {
    static std::atomic<unsigned> count = 0;
    const auto end = fmt::format(".tmp-{}-{}{}", ::getpid(), count++, target.extension().string());
    const std::string stem = target.stem().string();
    return target.parent_path() /
           ("." + shortened(stem, longest_name - 1 - std::min(end.size(), longest_name / 2)) + end);
}

/// A new, empty file under a temporary name. Who may write into the folder may guess the name and put a link to a file
/// elsewhere there: O_EXCL does not follow it, and the next name is taken.
fs::path new_temporary(const fs::path& target) {
    constexpr int tries = 1000;
    for (int i = 0;; ++i) {
        fs::path name = temporary_name(target);
        const int handle = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (handle >= 0) {
            ::close(handle);
            return name;
        }
        if (errno != EEXIST || i == tries)
            throw std::system_error(errno, std::generic_category(), "cannot be created");
    }
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

/// The folders that UnsyncedFolder names.
struct Unsynced {
    std::shared_mutex mutex;
    std::vector<std::string> folders; ///< with a slash at the end
};
Unsynced& unsynced() {
    static Unsynced all;
    return all;
}

bool is_synced(const fs::path& file) {
    std::shared_lock reading(unsynced().mutex);
    return std::ranges::none_of(unsynced().folders,
                                [&](const std::string& folder) { return file.native().starts_with(folder); });
}

fs::path folder_of(const fs::path& file) { return file.has_parent_path() ? file.parent_path() : fs::path("."); }

void sync_and_rename(const fs::path& temporary, const fs::path& target) {
    const bool synced = is_synced(target);
    if (synced)
        sync(temporary, O_RDONLY);
    fs::rename(temporary, target);
    if (synced)
        sync(folder_of(target), O_RDONLY | O_DIRECTORY);
}

void write_bytes(const fs::path& file, std::string_view bytes) {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(std::fopen(file.c_str(), "wb"), &std::fclose);
    if (!stream)
        throw std::system_error(errno, std::generic_category(), "cannot be created");
    const bool complete = std::fwrite(bytes.data(), 1, bytes.size(), stream.get()) == bytes.size();
    if (!complete || std::fflush(stream.get()) != 0)
        throw std::system_error(errno, std::generic_category(), "cannot be written");
}

/// Whether the system refuses for good, so that another path is needed.
bool needs_another_path(int error) {
    for (const int each : {EACCES, EPERM, EROFS, ENOTDIR, EISDIR, ENOENT, ENAMETOOLONG, ELOOP, EINVAL})
        if (error == each)
            return true;
    return false;
}

[[noreturn]] void refuse_output(const fs::path& output, const std::string& why, int error) {
    const std::string sentence =
        fmt::format("{}: cannot be written: {}: {}", output.string(), why, std::generic_category().message(error));
    if (needs_another_path(error))
        throw Misuse(sentence);
    throw Outage(sentence);
}

/// Makes a file there and removes it again. Permissions alone do not tell: root has them on file systems that take no
/// files, such as /proc.
void try_to_write(const fs::path& output, const fs::path& folder) {
    const fs::path probe = temporary_name(folder / "probe");
    const int handle = ::open(probe.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (handle < 0)
        refuse_output(output, "no file can be made in " + folder.string(), errno);
    ::close(handle);
    ::unlink(probe.c_str());
}

/// `output` is what the message names: the folder or a file in it.
void require_folder(const fs::path& output, const fs::path& folder) {
    for (const fs::path& part : output)
        if (part.native().size() > longest_name)
            refuse_output(output, fmt::format("a name of {} bytes", part.native().size()), ENAMETOOLONG);
    const auto or_here = [](const fs::path& path) { return path.empty() ? fs::path(".") : path; };
    fs::path there = or_here(folder);
    std::error_code trouble;
    fs::file_status status = fs::status(there, trouble);
    while (status.type() == fs::file_type::not_found) {
        if (std::error_code ignored; fs::is_symlink(fs::symlink_status(there, ignored)))
            refuse_output(output, there.string() + " is a link to a missing folder", ENOENT);
        there = or_here(there.parent_path());
        status = fs::status(there, trouble);
    }
    if (!fs::status_known(status))
        refuse_output(output, there.string(), trouble.value());
    if (status.type() != fs::file_type::directory)
        refuse_output(output, there.string(), ENOTDIR);
    try_to_write(output, there);
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

void publish(const fs::path& temporary, const fs::path& target) {
    during(target.string(), [&] {
        try {
            sync_and_rename(temporary, target);
        } catch (const std::system_error& failure) {
            throw Outage(std::string("not written: ") + failure.what());
        }
    });
}

void write_atomically(const fs::path& target, const std::function<void(const fs::path&)>& write) {
    fs::path temporary; // empty until there is one
    const auto clean_up = [&] {
        std::error_code ignored;
        if (!temporary.empty())
            fs::remove(temporary, ignored);
    };
    try {
        during(target.string(), [&] {
            try {
                fs::create_directories(folder_of(target));
                temporary = new_temporary(target);
                write(temporary);
                sync_and_rename(temporary, target);
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

UnsyncedFolder::UnsyncedFolder(fs::path folder) : folder_(std::move(folder)) {
    const std::unique_lock writing(unsynced().mutex);
    unsynced().folders.push_back((folder_ / "").string());
}

UnsyncedFolder::~UnsyncedFolder() {
    const std::unique_lock writing(unsynced().mutex);
    auto& folders = unsynced().folders;
    folders.erase(std::ranges::find(folders, (folder_ / "").string()));
}

void require_folder(const fs::path& folder) { require_folder(folder, folder); }

void require_file(const fs::path& file) {
    std::error_code trouble;
    const fs::file_status status = fs::status(file, trouble);
    if (!fs::status_known(status))
        refuse_output(file, "a file is expected", trouble.value());
    if (status.type() == fs::file_type::directory)
        refuse_output(file, "a file is expected", EISDIR);
    require_folder(file, file.parent_path());
}

std::string shortened(const std::string& name, std::size_t most_bytes) {
    constexpr std::size_t digits = 16;
    if (name.size() <= most_bytes)
        return name;
    std::size_t kept = most_bytes - digits - 1;
    while (kept > 0 && (static_cast<unsigned char>(name[kept]) & 0xc0) == 0x80) // characters stay whole
        --kept;
    return name.substr(0, kept) + "-" + hash_of(name).substr(0, digits);
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
