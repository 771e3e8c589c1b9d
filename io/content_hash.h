// What tells that an input is the one a result was made from: a hash of its content, and a cheap stamp to go by first.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace scanshade {

/// 128 bits of XXH3 as 32 hexadecimal digits: for telling changes, not for defence.
[[nodiscard]] std::string hash_of(std::string_view bytes);

/// The same of a file's content, read piece by piece. Throws Error naming the file where it cannot be read.
[[nodiscard]] std::string hash_of_file(const std::filesystem::path& file);

/// "SIZE:NANOSECONDS" of a file's last change, as `stat` tells; "" where there is no such file. Equal stamps are taken
/// for equal content, as git's index does.
[[nodiscard]] std::string stamp_of(const std::filesystem::path& file);

} // namespace scanshade
