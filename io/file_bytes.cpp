#include "io/file_bytes.h"

#include "io/files.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <cassert>
#include <cerrno>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace scanshade {

OpenFile::~OpenFile() { ::close(descriptor_); }

FileBytes::FileBytes(std::filesystem::path path) : path_(std::move(path)) {
    const int descriptor = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) {
        const std::error_code trouble(errno, std::generic_category());
        if (auto member = trouble == std::errc::not_a_directory ? stored_in_tar(path_) : std::nullopt)
            stored_ = *std::move(member);
        else
            fail_to_read(path_, trouble);
        return;
    }
    stored_.file = std::make_shared<const OpenFile>(descriptor);
    struct stat facts = {};
    if (::fstat(descriptor, &facts) != 0)
        fail_to_read(path_, {errno, std::generic_category()});
    stored_.size = static_cast<std::uint64_t>(facts.st_size);
}

std::string FileBytes::bytes(std::uint64_t at, std::uint64_t count) const {
    if (at > size() || count > size() - at)
        throw Error(fmt::format("{}: {} expected at byte {}, but the file ends at {}", path_.string(),
                                counted(count, "byte"), at, size()));
    require_memory(count, fmt::format("{}: {} at byte {}", path_.string(), counted(count, "byte"), at));
    std::string bytes(count, '\0');
    for (std::uint64_t done = 0; done < count;) {
        const ssize_t got = ::pread(stored_.file->descriptor(), bytes.data() + done, count - done,
                                    static_cast<off_t>(stored_.at + at + done));
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

StoredBytes FileBytes::part(std::uint64_t at, std::uint64_t size) const {
    assert(at <= this->size() && size <= this->size() - at);
    return {stored_.file, stored_.at + at, size};
}

} // namespace scanshade
