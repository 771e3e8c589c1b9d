// Unpacks deflate, as zlib streams, as gzip and as bare ones.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace scanshade {

enum class Inflate { zlib, raw, gzip };

/// All bytes of one stream, of which there may be at most `most`. Throws Error for damage, for bytes after the
/// stream's end, and for more than that; the message names no file.
[[nodiscard]] std::string inflated(std::string_view packed, Inflate form, std::size_t most);
/// The first bytes of one stream, `count` or all. Throws Error where they are damaged or not there.
[[nodiscard]] std::string inflated_start(std::string_view packed, Inflate form, std::size_t count);

} // namespace scanshade
