// Locks tell what is in work: a folder whose task's journal is not locked belongs to nobody.
#include "apps/jobs/scratch.h"

#include "apps/results/journal.h"
#include "apps/walk/progress.h"
#include "io/content_hash.h"
#include "projection/base/error.h"

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <fstream>
#include <sys/file.h>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr auto poll_every = std::chrono::milliseconds(100);
constexpr const char* journal_name = "journal-of-this-task";
constexpr const char* removed_mark = ".removed-";

/// A folder of ours alone: its path can be guessed, and others may write to /tmp.
void make_private(const fs::path& folder) {
    if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST)
        throw Misuse(fmt::format("--scratch: {}: cannot be made: {}", folder.string(), std::strerror(errno)));
    struct stat status = {};
    if (::lstat(folder.c_str(), &status) != 0 || !S_ISDIR(status.st_mode) || status.st_uid != ::geteuid() ||
        (status.st_mode & (S_IWGRP | S_IWOTH)) != 0)
        throw Misuse(
            fmt::format("--scratch: {} is not a folder of this user alone: choose another one", folder.string()));
}

std::vector<fs::path> task_folders(const fs::path& folder) {
    std::vector<fs::path> folders;
    std::error_code trouble;
    for (fs::directory_iterator entry(folder, trouble), end; !trouble && entry != end; entry.increment(trouble))
        if (std::error_code gone; entry->is_directory(gone))
            folders.push_back(entry->path());
    return folders;
}

fs::path journal_of(const fs::path& folder) {
    std::ifstream stream(folder / journal_name, std::ios::binary);
    return std::string{std::istreambuf_iterator<char>(stream), {}};
}

} // namespace

Scratch::Scratch(const fs::path& root, const fs::path& job, std::uint64_t limit_bytes) {
    std::error_code trouble;
    const fs::path base = root.empty() ? fs::temp_directory_path() : fs::absolute(root);
    if (!root.empty())
        fs::create_directories(base, trouble);
    constexpr std::size_t digits = 16;
    folder_ = base / ("scanshade-" + hash_of(fs::weakly_canonical(job, trouble).string()).substr(0, digits));
    make_private(folder_);
    limit_ = limit_bytes;
    if (limit_ == 0) {
        const fs::space_info space = fs::space(folder_, trouble);
        if (trouble)
            throw Outage(fmt::format("--scratch: {}: {}", folder_.string(), trouble.message()));
        limit_ = space.available / 2;
        say(fmt::format("{}: at most {:.1f} GB, half of what is free; --scratch-limit sets another limit",
                        folder_.string(), static_cast<double>(limit_) / 1e9));
    }
    remove_remains(true);
}

fs::path Scratch::path_of(const std::string& task) const {
    constexpr std::size_t digits = 32;
    return folder_ / hash_of(task).substr(0, digits);
}

fs::path Scratch::folder_of(const std::string& task, const fs::path& journal) const {
    fs::path folder = path_of(task);
    constexpr int tries = 3; // another process may take an empty folder for remains
    for (int attempt = 1; attempt <= tries; ++attempt) {
        std::error_code trouble;
        fs::create_directory(folder, trouble);
        std::ofstream stream(folder / journal_name, std::ios::binary);
        stream << fs::absolute(journal).string();
        stream.close();
        if (stream)
            return folder;
    }
    throw Outage(fmt::format("--scratch: {}: cannot be written: {}", folder.string(), std::strerror(errno)));
}

void Scratch::remove(const fs::path& folder) {
    // Under another name, so that one killed amid this leaves no task's folder that lacks its parts.
    const fs::path removed = folder.parent_path() / fmt::format("{}{}", removed_mark, folder.filename().string());
    std::error_code trouble;
    fs::remove_all(removed, trouble);
    fs::rename(folder, removed, trouble);
    fs::remove_all(removed, trouble);
    if (trouble)
        warn(fmt::format("{}: cannot be removed: {}", folder.string(), trouble.message()));
}

// As `du` counts; what vanishes meanwhile counts as nothing.
std::uint64_t Scratch::used_by(const fs::path& folder) {
    std::uint64_t bytes = 0;
    std::error_code trouble;
    for (fs::recursive_directory_iterator entry(folder, trouble), end; !trouble && entry != end;
         entry.increment(trouble)) {
        struct stat status = {};
        if (::lstat(entry->path().c_str(), &status) == 0)
            bytes += static_cast<std::uint64_t>(status.st_blocks) * 512;
    }
    return bytes;
}

void Scratch::remove_remains(bool ended_only, const fs::path& own) const {
    for (const fs::path& folder : task_folders(folder_)) {
        if (folder == own)
            continue;
        const fs::path journal = journal_of(folder);
        std::error_code in_use_after_all;
        if (folder.filename().string().starts_with(removed_mark))
            fs::remove_all(folder, in_use_after_all);
        else if (journal.empty())
            fs::remove(folder, in_use_after_all); // only where it is empty
        if (journal.empty() || (ended_only && !is_complete(journal, "ended")))
            continue;
        const int handle = ::open(journal.c_str(), O_RDONLY | O_CLOEXEC);
        if (handle < 0 && errno != ENOENT)
            continue;
        // A journal that is gone is that of a job that was removed.
        if (handle < 0 || ::flock(handle, LOCK_EX | LOCK_NB) == 0)
            remove(folder);
        if (handle >= 0)
            ::close(handle);
    }
}

bool Scratch::others_at_work(const fs::path& own) const {
    for (const fs::path& folder : task_folders(folder_)) {
        std::error_code gone;
        if (folder != own && !journal_of(folder).empty() && fs::exists(input_in(folder), gone) &&
            in_use(journal_of(folder)))
            return true;
    }
    return false;
}

Scratch::Turn::Turn(Scratch& scratch, const std::atomic<bool>& stop)
    : lock_(scratch.turn_, std::defer_lock),
      handle_(::open((scratch.folder_ / ".fetching").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)) {
    const auto got = [&] {
        return (lock_.owns_lock() || lock_.try_lock_for(poll_every)) &&
               (handle_ < 0 || ::flock(handle_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK);
    };
    while (!got()) {
        if (stop) {
            if (handle_ >= 0)
                ::close(handle_);
            throw Outage("interrupted before its input was fetched");
        }
        if (lock_.owns_lock())
            std::this_thread::sleep_for(poll_every);
    }
}

Scratch::Turn::~Turn() {
    if (handle_ >= 0)
        ::close(handle_);
}

void Scratch::make_room(std::uint64_t bytes, const fs::path& own, const std::atomic<bool>& stop) {
    bool told = false, cleared = false;
    while (used() + bytes > limit_) {
        if (!cleared)
            remove_remains(false, own);
        else if (!others_at_work(own)) // the fetch will show whether it fits
            return;
        else if (!std::exchange(told, true))
            say(fmt::format("waits for space: {:.2f} of {:.2f} GB in {} are taken", static_cast<double>(used()) / 1e9,
                            static_cast<double>(limit_) / 1e9, folder_.string()));
        if (stop)
            throw Outage("interrupted before its input was fetched");
        if (std::exchange(cleared, true))
            std::this_thread::sleep_for(poll_every);
    }
}

} // namespace scanshade
