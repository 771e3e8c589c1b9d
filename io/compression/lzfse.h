// Unpacks LZFSE, Apple's packing of arrays, as Record3D uses it.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace scanshade {

/// All bytes of one stream, of which there may be at most `most`. Throws Error, naming the byte in `packed`, for
/// damage, for bytes after the stream's end, and for more than that.
[[nodiscard]] std::string unpacked_lzfse(std::string_view packed, std::size_t most);

} // namespace scanshade
