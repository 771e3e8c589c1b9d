#include "io/file_bytes.h"

#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <cerrno>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace scanshade {

FileBytes::FileBytes(std::filesystem::path path)
    : path_(std::move(path)), descriptor_(::open(path_.c_str(), O_RDONLY | O_CLOEXEC)) {
    struct stat facts = {};
    if (descriptor_ < 0 || ::fstat(descriptor_, &facts) != 0) {
        const std::error_code trouble(errno, std::generic_category());
        if (descriptor_ >= 0)
            ::close(descriptor_);
        fail_to_read(path_, trouble);
    }
    size_ = static_cast<std::uint64_t>(facts.st_size);
}

FileBytes::~FileBytes() { ::close(descriptor_); }

std::string FileBytes::bytes(std::uint64_t at, std::uint64_t count) const {
    if (at > size_ || count > size_ - at)
        throw Error(fmt::format("{}: {} expected at byte {}, but the file ends at {}", path_.string(),
                                counted(count, "byte"), at, size_));
    require_memory(count, fmt::format("{}: {} at byte {}", path_.string(), counted(count, "byte"), at));
    std::string bytes(count, '\0');
    for (std::uint64_t done = 0; done < count;) {
        const ssize_t got = ::pread(descriptor_, bytes.data() + done, count - done, static_cast<off_t>(at + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            fail_to_read(path_, {errno, std::generic_category()});
        if (got == 0)
            throw Error(
                fmt::format("{}: it became shorter while it was read: nothing at byte {}", path_.string(), at + done));
        done += static_cast<std::uint64_t>(got);
    }
    return bytes;
}

} // namespace scanshade
