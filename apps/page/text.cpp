// Bytes and names as pages and their scripts hold them.
#include "apps/page/text.h"

#include "io/compression/deflate.h"

#include <cstddef>

namespace scanshade::page {

std::string escaped(std::string_view text) {
    std::string html;
    for (const char c : text)
        switch (c) {
        case '<':
            html += "&lt;";
            break;
        case '>':
            html += "&gt;";
            break;
        case '&':
            html += "&amp;";
            break;
        case '"':
            html += "&quot;";
            break;
        case '\'':
            html += "&#39;";
            break;
        default:
            html += c;
        }
    return html;
}

std::string for_script(std::string_view json_text) {
    std::string script;
    script.reserve(json_text.size());
    for (std::size_t i = 0; i < json_text.size(); ++i) {
        const std::string_view rest = json_text.substr(i);
        if (rest.front() == '<')
            script += "\\u003c";
        else if (rest.front() == '&')
            script += "\\u0026";
        else if (rest.starts_with("\xE2\x80\xA8") || rest.starts_with("\xE2\x80\xA9")) {
            script += rest[2] == '\xA8' ? "\\u2028" : "\\u2029";
            i += 2;
        } else
            script += rest.front();
    }
    return script;
}

std::string base64(std::string_view bytes) {
    constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string coded((bytes.size() + 2) / 3 * 4, '=');
    const auto byte = [&](std::size_t i) { return unsigned{static_cast<unsigned char>(bytes[i])}; };
    char* to = coded.data();
    std::size_t i = 0;
    for (; i + 3 <= bytes.size(); i += 3, to += 4) {
        const unsigned group = byte(i) << 16 | byte(i + 1) << 8 | byte(i + 2);
        to[0] = digits[group >> 18];
        to[1] = digits[group >> 12 & 63];
        to[2] = digits[group >> 6 & 63];
        to[3] = digits[group & 63];
    }
    if (const std::size_t left = bytes.size() - i; left > 0) {
        const unsigned group = byte(i) << 16 | (left > 1 ? byte(i + 1) << 8 : 0U);
        to[0] = digits[group >> 18];
        to[1] = digits[group >> 12 & 63];
        if (left > 1)
            to[2] = digits[group >> 6 & 63];
    }
    return coded;
}

std::string packed(std::string_view bytes) { return base64(deflated(bytes)); }

} // namespace scanshade::page
