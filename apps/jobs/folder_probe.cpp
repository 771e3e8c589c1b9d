#include "apps/jobs/folder_probe.h"

#include "apps/walk/progress.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// A file of this process alone, removed with the object.
class ProbeFile {
  public:
    ProbeFile(const fs::path& folder, const char* name)
        : path_(folder / fmt::format(".probe-{}-{}", ::getpid(), name)),
          handle_(::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666)) {
        if (handle_ < 0)
            throw Outage(fmt::format("{}: cannot be made: {}", path_.string(), std::strerror(errno)));
    }
    ~ProbeFile() {
        ::close(handle_);
        ::unlink(path_.c_str());
    }
    ProbeFile(const ProbeFile&) = delete;
    ProbeFile& operator=(const ProbeFile&) = delete;
    [[nodiscard]] const fs::path& path() const { return path_; }
    [[nodiscard]] int handle() const { return handle_; }

  private:
    fs::path path_;
    int handle_;
};

int lock(const FolderCalls& calls, int handle, int operation) {
    return calls.flock ? calls.flock(handle, operation) : ::flock(handle, operation);
}

/// What another process meets when it locks the file: 0, or the error.
int lock_by_another_process(const FolderCalls& calls, const fs::path& file) {
    const pid_t child = ::fork();
    if (child == 0) {
        const int handle = ::open(file.c_str(), O_RDWR | O_CLOEXEC);
        const bool locked = handle >= 0 && lock(calls, handle, LOCK_EX | LOCK_NB) == 0;
        ::_exit(locked ? 0 : errno & 0xff);
    }
    int status = 0;
    if (child < 0 || ::waitpid(child, &status, 0) != child)
        throw Outage(fmt::format("no process to try locks with: {}", std::strerror(errno)));
    return WIFEXITED(status) ? WEXITSTATUS(status) : EINTR;
}

std::string text_in(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

/// Paths in mountinfo: "\040" is a blank.
std::string unescaped(std::string_view text) {
    std::string plain;
    for (std::size_t i = 0; i < text.size(); ++i)
        if (text[i] == '\\' && i + 3 < text.size() && text[i + 1] <= '3' && text[i + 1] >= '0') {
            plain += static_cast<char>((text[i + 1] - '0') * 64 + (text[i + 2] - '0') * 8 + (text[i + 3] - '0'));
            i += 3;
        } else {
            plain += text[i];
        }
    return plain;
}

} // namespace

std::string renames_fail_in(const fs::path& folder, const FolderCalls& calls) {
    const ProbeFile from(folder, "new"), to(folder, "old");
    constexpr std::string_view word = "new";
    if (::write(from.handle(), word.data(), word.size()) != static_cast<ssize_t>(word.size()))
        throw Outage(fmt::format("{}: cannot be written: {}", from.path().string(), std::strerror(errno)));
    const int failed = calls.rename ? calls.rename(from.path().c_str(), to.path().c_str())
                                    : std::rename(from.path().c_str(), to.path().c_str());
    if (failed != 0)
        return fmt::format("a file cannot be renamed onto another: {}", std::strerror(errno));
    std::error_code ignored;
    if (text_in(to.path()) != word || fs::exists(from.path(), ignored))
        return "a file that is renamed onto another does not replace it";
    return "";
}

std::string locks_fail_in(const fs::path& folder, const FolderCalls& calls) {
    const ProbeFile file(folder, "lock");
    if (lock(calls, file.handle(), LOCK_EX | LOCK_NB) != 0)
        return fmt::format("files cannot be locked: {}", std::strerror(errno));
    if (const int met = lock_by_another_process(calls, file.path()); met == 0)
        return "two processes lock the same file at once";
    else if (met != EWOULDBLOCK)
        return fmt::format("a lock of another process cannot be seen: {}", std::strerror(met));
    if (lock(calls, file.handle(), LOCK_UN) != 0)
        return fmt::format("a lock cannot be given back: {}", std::strerror(errno));
    if (const int met = lock_by_another_process(calls, file.path()); met != 0)
        return fmt::format("a lock that was given back stays: {}", std::strerror(met));
    return "";
}

std::string local_locks_option(const fs::path& folder, const std::string& mounts) {
    std::string best, option;
    for (const TextLine& line : text_lines(mounts)) {
        const std::vector<std::string_view> fields = words(line.text);
        constexpr std::size_t point = 4;
        if (fields.size() <= point)
            continue;
        const std::string mounted = unescaped(fields[point]);
        const bool above = mounted == "/" || folder == mounted || folder.string().starts_with(mounted + "/");
        if (!above || mounted.size() < best.size())
            continue;
        best = mounted;
        option.clear();
        std::string options = ",";
        for (const std::string_view field : fields)
            options += std::string(field) + ",";
        for (const char* each : {"local_lock=all", "local_lock=flock", "nolock", "localflock"})
            if (options.find(fmt::format(",{},", each)) != std::string::npos)
                option = each;
    }
    return option;
}

void require_job_folder(const fs::path& folder, bool locks) {
    std::error_code trouble;
    fs::create_directories(folder, trouble);
    if (const std::string why = renames_fail_in(folder); !why.empty())
        throw Misuse(fmt::format("{}: {}. A job's folder must be on a disk that renames files, which object stores do "
                                 "not do: put it on another one, and let plan --fetch and --deliver reach the store",
                                 folder.string(), why));
    if (!locks)
        return;
    if (const std::string why = locks_fail_in(folder); !why.empty())
        throw Misuse(
            fmt::format("{}: {}. A job's folder must be on a disk with locks: NFS 4, Lustre mounted with flock, "
                        "a local disk. Put it there (plan --fetch and --deliver reach other storage), or give "
                        "--no-locks and see to it that no shard runs twice at a time",
                        folder.string(), why));
    const fs::path whole = fs::weakly_canonical(folder, trouble);
    if (const std::string option = local_locks_option(whole, text_in("/proc/self/mountinfo")); !option.empty())
        warn(fmt::format("{}: mounted with {}, so that locks hold on this machine only: on several machines give "
                         "--no-locks, and see to it that no shard runs twice at a time",
                         folder.string(), option));
}

} // namespace scanshade
