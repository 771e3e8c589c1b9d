#include "io/tar_output.h"

#include "projection/base/error.h"

#include <cerrno>
#include <fcntl.h>
#include <fmt/format.h>
#include <string>
#include <system_error>
#include <unistd.h>

namespace scanshade {

namespace {

constexpr std::size_t tar_block = 512, record_bytes = 20 * tar_block;

[[noreturn]] void fail_to_write(const std::filesystem::path& file, const char* what) {
    throw Outage(fmt::format("{}: {}: {}", file.string(), what, std::generic_category().message(errno)));
}

void sync_tar(const std::filesystem::path& file, int handle) {
    if (::fsync(handle) != 0 && errno != EINVAL) // EINVAL: a file system without fsync
        fail_to_write(file, "cannot be synced");
}

/// A header of POSIX.1-2001. Fields end with a NUL.
std::string header_of(std::string_view name, std::uint64_t size, char kind) {
    std::string header(tar_block, '\0');
    const auto put = [&](std::size_t at, std::string_view text) { header.replace(at, text.size(), text); };
    put(0, name.substr(0, 100));
    put(100, "0000644");
    put(108, "0000000");
    put(116, "0000000");
    put(124, fmt::format("{:011o}", size));
    put(136, "00000000000");
    put(148, "        ");
    header[156] = kind;
    put(257, "ustar");
    put(263, "00");
    put(329, "0000000");
    put(337, "0000000");
    std::uint32_t sum = 0;
    for (const char c : header)
        sum += static_cast<unsigned char>(c);
    put(148, fmt::format("{:06o}", sum));
    header[154] = '\0';
    return header;
}

/// "LENGTH KEY=VALUE\n", whose length counts itself.
std::string pax_record(std::string_view key, std::string_view value) {
    const std::size_t rest = key.size() + value.size() + 3;
    std::size_t length = rest + 1;
    while (length != rest + std::to_string(length).size())
        length = rest + std::to_string(length).size();
    return fmt::format("{} {}={}\n", length, key, value);
}

std::string padding_for(std::uint64_t bytes, std::size_t unit) {
    return std::string((unit - static_cast<std::size_t>(bytes % unit)) % unit, '\0');
}

} // namespace

TarOutput::TarOutput(std::filesystem::path file)
    : file_(std::move(file)),
      handle_(::open(file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0666)) {
    if (handle_ < 0)
        fail_to_write(file_, "cannot be created");
}

TarOutput::~TarOutput() {
    if (handle_ >= 0)
        ::close(handle_);
}

void TarOutput::write(std::string_view bytes) {
    written_ += bytes.size();
    while (!bytes.empty()) {
        const ssize_t took = ::write(handle_, bytes.data(), bytes.size());
        if (took < 0 && errno == EINTR)
            continue;
        if (took < 0)
            fail_to_write(file_, "cannot be written");
        bytes.remove_prefix(static_cast<std::size_t>(took));
    }
}

void TarOutput::add(std::string_view name, std::string_view bytes) {
    constexpr std::size_t longest = 100;
    constexpr std::uint64_t largest = (std::uint64_t(1) << 33) - 1;
    std::string head;
    if (name.size() > longest || bytes.size() > largest) {
        const std::string records =
            pax_record("path", name) + (bytes.size() > largest ? pax_record("size", std::to_string(bytes.size())) : "");
        head = header_of("PaxHeader", records.size(), 'x') + records + padding_for(records.size(), tar_block);
    }
    head += header_of(name, std::min<std::uint64_t>(bytes.size(), largest), '0');
    write(head);
    write(bytes);
    write(padding_for(bytes.size(), tar_block));
}

void TarOutput::finish(const std::filesystem::path& target) {
    write(std::string(2 * tar_block, '\0'));
    write(padding_for(written_, record_bytes));
    sync_tar(file_, handle_);
    if (::rename(file_.c_str(), target.c_str()) != 0)
        fail_to_write(target, "cannot be written");
    const int folder = ::open(target.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0)
        fail_to_write(target.parent_path(), "cannot be opened");
    const int failed = ::fsync(folder) == 0 || errno == EINVAL ? 0 : errno;
    ::close(folder);
    errno = failed;
    if (failed != 0)
        fail_to_write(target, "cannot be synced");
}

} // namespace scanshade
