// Bytes and names as pages and their scripts hold them. Names come from files of others: none may end a string, a tag
// or an address early.
#pragma once

#include <string>
#include <string_view>

namespace scanshade::page {

/// For HTML, in text and in attributes.
[[nodiscard]] std::string escaped(std::string_view text);

/// A JSON text as a script may hold it, within HTML too: no "<", no "&", and no line separator of Unicode.
[[nodiscard]] std::string for_script(std::string_view json_text);

/// RFC 4648, without line breaks.
[[nodiscard]] std::string base64(std::string_view bytes);
/// The same of a zlib stream of the bytes: scripts unpack it.
[[nodiscard]] std::string packed(std::string_view bytes);

} // namespace scanshade::page
