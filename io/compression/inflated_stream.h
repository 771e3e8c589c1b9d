// A long deflate stream in a file, of which any part can be unpacked without all that is before it.
#pragma once

#include "io/file_bytes.h"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

struct z_stream_s;

namespace scanshade {

/// A bare deflate stream. Several threads may read at once.
class InflatedStream {
  public:
    /// Unpacks it once, to count its bytes and to keep states of the decoder on the way. `file` must outlive this.
    /// Throws Error as FileBytes, and for more than `most` unpacked bytes; damage is no error here.
    InflatedStream(const FileBytes& file, std::uint64_t at, std::uint64_t packed_bytes, std::uint64_t most);

    /// Of what is whole, unpacked.
    [[nodiscard]] std::uint64_t size() const { return size_; }
    /// Empty where the stream ends with its packed bytes; else what is wrong behind size().
    [[nodiscard]] const std::string& damage() const { return damage_; }
    /// Throws Error where these bytes are not there.
    [[nodiscard]] std::string bytes(std::uint64_t at, std::uint64_t count) const;
    /// CRC-32 of what is whole.
    [[nodiscard]] std::uint32_t crc() const { return crc_; }

  private:
    struct End {
        void operator()(z_stream_s* stream) const;
    };
    struct State {
        std::unique_ptr<z_stream_s, End> stream;
        std::uint64_t packed = 0, unpacked = 0; ///< bytes before it
    };
    static std::unique_ptr<z_stream_s, End> copy_of(z_stream_s& stream);
    void keep(z_stream_s& stream, std::uint64_t packed);

    const FileBytes& file_;
    std::uint64_t at_, packed_bytes_, size_ = 0;
    std::uint64_t apart_; ///< between kept states, unpacked
    std::uint32_t crc_ = 0;
    std::string damage_;
    std::vector<State> states_;
};

} // namespace scanshade
