// The records of MCAP, which its reader and its writer share: operations, and the numbers and texts of a record
// (mcap.dev/spec).
#pragma once

#include "io/text.h"
#include "projection/base/error.h"

#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <string_view>

namespace scanshade::ros {

enum class Op : std::uint8_t {
    header = 1,
    footer = 2,
    schema = 3,
    channel = 4,
    message = 5,
    chunk = 6,
    message_index = 7,
    chunk_index = 8,
    statistics = 11,
    metadata = 12,
    metadata_index = 13,
    summary_offset = 14,
    data_end = 15
};

/// The numbers and strings of a record, one after the other. Throws Error where they end early.
class RecordContent {
  public:
    explicit RecordContent(std::string_view bytes) : bytes_(bytes) {}
    template <class Number>
    Number next() {
        Number value{};
        std::memcpy(&value, take(sizeof value).data(), sizeof value);
        return value;
    }
    std::string_view text() { return take(next<std::uint32_t>()); }
    std::string_view take(std::uint64_t count) {
        if (count > bytes_.size() - at_)
            throw Error(fmt::format("{} at byte {} of a record of {}", counted(count, "byte"), at_, bytes_.size()));
        at_ += count;
        return bytes_.substr(at_ - count, count);
    }
    [[nodiscard]] bool more() const { return at_ < bytes_.size(); }
    [[nodiscard]] std::size_t at() const { return at_; }

  private:
    std::string_view bytes_;
    std::size_t at_ = 0;
};

} // namespace scanshade::ros
