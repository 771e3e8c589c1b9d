// What the parts of an HDF5 file are made of: little-endian fields in blocks at addresses, messages of object headers.
#pragma once

#include "io/file_bytes.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::hdf5 {

constexpr std::uint64_t nowhere = ~std::uint64_t(0); ///< an address that is not defined

/// Parts of a file whose addresses count from `base`.
struct Source {
    const FileBytes& file;
    std::uint64_t base = 0;

    /// Throws Error where these bytes are not in the file.
    [[nodiscard]] std::string bytes(std::uint64_t address, std::uint64_t count) const;
    /// "file: byte 1234"
    [[nodiscard]] std::string at(std::uint64_t address) const;
    [[noreturn]] void refuse(std::uint64_t address, const std::string& why) const;
};

/// Reads one field after the other; the end of the bytes is an Error that begins with `where`.
class Fields {
  public:
    Fields(std::string bytes, std::string where) : bytes_(std::move(bytes)), where_(std::move(where)) {}

    [[nodiscard]] std::uint64_t number(std::size_t bytes); ///< of 1 to 8 bytes
    [[nodiscard]] std::uint8_t u8() { return static_cast<std::uint8_t>(number(1)); }
    [[nodiscard]] std::uint16_t u16() { return static_cast<std::uint16_t>(number(2)); }
    [[nodiscard]] std::uint32_t u32() { return static_cast<std::uint32_t>(number(4)); }
    [[nodiscard]] std::uint64_t u64() { return number(8); }
    [[nodiscard]] std::string_view take(std::uint64_t count);
    void skip(std::uint64_t count) { (void)take(count); }
    [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }
    [[nodiscard]] const std::string& where() const { return where_; }
    /// Throws Error unless these four letters follow.
    void expect(std::string_view signature);

  private:
    std::string bytes_, where_;
    std::size_t at_ = 0;
};

/// IV.A.2 of the specification.
enum class MessageType : std::uint16_t {
    dataspace = 0x01,
    link_info = 0x02,
    datatype = 0x03,
    link = 0x06,
    external_files = 0x07,
    layout = 0x08,
    filters = 0x0b,
    continuation = 0x10,
    symbol_table = 0x11,
};

struct Message {
    MessageType type = {};
    bool shared = false; ///< it is elsewhere
    std::uint64_t at = 0;
    std::string data;
};

/// Of the object whose header is at that address.
[[nodiscard]] std::vector<Message> messages_of(const Source& source, std::uint64_t address);

} // namespace scanshade::hdf5
