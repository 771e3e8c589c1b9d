// Recognises the input that a result was made from, by a hash of its content and, more cheaply, by a stamp.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace scanshade {

/// 128 bits of XXH3 as 32 hexadecimal digits: it detects changes, but is not cryptographic.
[[nodiscard]] std::string hash_of(std::string_view bytes);

/// The same of a file's content, read piece by piece. Throws Error naming the file where it cannot be read.
[[nodiscard]] std::string hash_of_file(const std::filesystem::path& file);

/// "SIZE:NANOSECONDS" of a file's last change, from `stat`; "" where there is no such file. Equal stamps are taken
/// for equal content, as git's index does.
[[nodiscard]] std::string stamp_of(const std::filesystem::path& file);

} // namespace scanshade
