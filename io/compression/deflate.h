// zlib streams, as PNG files and pages hold them. ISA-L packs in a quarter of zlib's time, to the same size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace scanshade {

/// Packs bytes in pieces into one zlib stream; equal bytes give equal streams.
class Packer {
  public:
    Packer();
    ~Packer();
    Packer(const Packer&) = delete;
    Packer& operator=(const Packer&) = delete;
    /// Appends to `packed` what the stream gives so far, all of it with the last piece.
    void append(std::string_view bytes, bool last, std::string& packed);

  private:
    struct State;
    std::unique_ptr<State> state_;
};

/// All bytes as one zlib stream.
[[nodiscard]] std::string deflated(std::string_view bytes);

} // namespace scanshade
