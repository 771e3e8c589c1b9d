// Packed chunks and messages: bz2, LZ4 frames, zstd frames.
#pragma once

#include "io/file_bytes.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::ros {

/// Each throws Error, without a file's name, for damage and where the result is not `size` bytes.
[[nodiscard]] std::string unpacked_bz2(std::string_view packed, std::size_t size);
[[nodiscard]] std::string unpacked_lz4(std::string_view packed, std::size_t size);
[[nodiscard]] std::string unpacked_zstd(std::string_view packed, std::size_t size);
/// The size that a zstd frame names. Throws Error where it names none.
[[nodiscard]] std::size_t size_of_zstd(std::string_view packed);

/// Throws Error for sizes that no packer gives: beyond 2^31, or more than `most_ratio` times what is packed.
void check_unpacked_size(std::uint64_t packed, std::uint64_t size);

/// A packed part of a file that holds many messages.
struct Chunk {
    std::uint64_t at = 0, packed = 0, size = 0;
    std::string compression;
};

/// Unpacked chunks, of which the last few stay in memory: messages of one frame lie close together.
class Chunks {
  public:
    using Unpack = std::string (*)(std::string_view packed, const Chunk& chunk);
    Chunks(const FileBytes& file, Unpack unpack) : file_(file), unpack_(unpack) {}

    std::vector<Chunk> chunks;
    /// Throws Error naming file and place.
    [[nodiscard]] std::shared_ptr<const std::string> unpacked(std::uint32_t chunk) const;

  private:
    struct Kept {
        std::uint32_t chunk;
        std::shared_ptr<const std::string> bytes;
    };
    const FileBytes& file_;
    Unpack unpack_;
    mutable std::mutex mutex_;
    mutable std::vector<Kept> kept_; ///< last used last
};

} // namespace scanshade::ros
