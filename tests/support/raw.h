// A number's bytes, as files of this machine's byte order have them.
#pragma once

#include <cstring>
#include <string>

namespace scanshade::tests {

template <class Number>
std::string raw(Number value) {
    std::string bytes(sizeof value, '\0');
    std::memcpy(bytes.data(), &value, sizeof value);
    return bytes;
}

} // namespace scanshade::tests
