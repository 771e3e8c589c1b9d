#include "io/utf16.h"

#include <cstdint>

namespace scanshade {

namespace {

void append_utf8(std::string& text, std::uint32_t code) {
    const auto part = [&](std::uint32_t mark, int shift, std::uint32_t mask) {
        text += static_cast<char>(mark | ((code >> shift) & mask));
    };
    if (code < 0x80) {
        part(0, 0, 0x7f);
    } else if (code < 0x800) {
        part(0xc0, 6, 0x1f);
        part(0x80, 0, 0x3f);
    } else if (code < 0x10000) {
        part(0xe0, 12, 0x0f);
        part(0x80, 6, 0x3f);
        part(0x80, 0, 0x3f);
    } else {
        part(0xf0, 18, 0x07);
        part(0x80, 12, 0x3f);
        part(0x80, 6, 0x3f);
        part(0x80, 0, 0x3f);
    }
}

} // namespace

std::string plain_text(std::string bytes) {
    const bool little = bytes.starts_with("\xff\xfe"), big = bytes.starts_with("\xfe\xff");
    if (!little && !big)
        return bytes;
    const auto unit = [&](std::size_t at) {
        const auto first = static_cast<unsigned char>(bytes[at]), second = static_cast<unsigned char>(bytes[at + 1]);
        return static_cast<std::uint32_t>(little ? first | second << 8 : first << 8 | second);
    };
    constexpr std::uint32_t high = 0xd800, low = 0xdc00, behind = 0xe000;
    std::string text;
    text.reserve(bytes.size() / 2);
    for (std::size_t at = 2; at + 1 < bytes.size(); at += 2) {
        const std::uint32_t first = unit(at);
        const std::uint32_t next = at + 3 < bytes.size() ? unit(at + 2) : 0;
        if (first >= high && first < low && next >= low && next < behind) {
            append_utf8(text, 0x10000 + ((first - high) << 10) + (next - low));
            at += 2;
        } else {
            append_utf8(text, first >= high && first < behind ? '?' : first);
        }
    }
    return text;
}

} // namespace scanshade
