// Pages of 1020 bytes of content and a checksum.
#include "io/clouds/e57/e57.h"

#include "io/checksum.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <array>
#include <atomic>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <tbb/parallel_for.h>

namespace scanshade::e57 {

namespace {

constexpr std::size_t page_size = 1024, page_content = 1020;

/// Remainders of a byte, and of a byte followed by 1 .. 7 zero bytes: eight bytes are divided at once.
constexpr auto remainders = [] {
    std::array<std::array<std::uint32_t, 256>, 8> tables{};
    for (std::uint32_t byte = 0; byte < 256; ++byte) {
        std::uint32_t rest = byte;
        for (int bit = 0; bit < 8; ++bit)
            rest = rest >> 1 ^ ((rest & 1) != 0 ? 0x82f63b78U : 0U);
        tables[0][byte] = rest;
    }
    for (std::size_t zeros = 1; zeros < 8; ++zeros)
        for (std::size_t byte = 0; byte < 256; ++byte) {
            const std::uint32_t before = tables[zeros - 1][byte];
            tables[zeros][byte] = before >> 8 ^ tables[0][before & 0xff];
        }
    return tables;
}();

} // namespace

std::uint32_t checksum(std::string_view bytes) {
    std::uint32_t rest = 0xffffffff;
    while (bytes.size() >= 8) {
        std::uint64_t eight = 0;
        std::memcpy(&eight, bytes.data(), 8);
        eight ^= rest;
        rest = 0;
        for (std::size_t k = 0; k < 8; ++k)
            rest ^= remainders[7 - k][eight >> (8 * k) & 0xff];
        bytes.remove_prefix(8);
    }
    for (const char byte : bytes)
        rest = rest >> 8 ^ remainders[0][(rest ^ static_cast<unsigned char>(byte)) & 0xff];
    return ~rest;
}

std::string without_pages(std::string_view file) {
    if (file.size() < page_size || file.size() % page_size != 0)
        throw Error(fmt::format("{} bytes are not whole pages of {}: the file is cut short", file.size(), page_size));
    const std::size_t pages = file.size() / page_size;
    require_memory(file.size(), "the contents of E57");
    std::string contents(pages * page_content, '\0');
    constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
    std::atomic<std::size_t> damaged = none; // the first of them
    const auto sums = [&](std::size_t page) {
        const std::string_view all = file.substr(page * page_size, page_size);
        std::uint32_t stored = 0;
        for (const char byte : all.substr(page_content))
            stored = stored << 8 | static_cast<unsigned char>(byte);
        return std::pair(checksum(all.substr(0, page_content)), stored);
    };
    tbb::parallel_for(std::size_t(0), pages, [&](std::size_t page) {
        const auto [found, stored] = sums(page);
        std::size_t first = damaged;
        while (!sums_agree(found, stored) && page < first && !damaged.compare_exchange_weak(first, page)) {
        }
        file.substr(page * page_size).copy(contents.data() + page * page_content, page_content);
    });
    if (damaged != none) {
        const auto [found, stored] = sums(damaged);
        throw Error(fmt::format("page {} (byte {}): checksum {:08x}, stored {:08x}: the file is damaged",
                                damaged.load(), damaged * page_size, found, stored));
    }
    return contents;
}

} // namespace scanshade::e57
