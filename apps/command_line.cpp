#include "apps/command_line.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <string_view>

namespace scanshade {
namespace {

/// A word, quoted for a shell.
std::string as_typed(const std::string& word) {
    const bool plain = std::ranges::all_of(word, [](unsigned char c) {
        return std::isalnum(c) || c >= 0x80 ||
               std::string_view("_-+=.,:/@%").find(static_cast<char>(c)) != std::string_view::npos;
    });
    if (plain && !word.empty())
        return word;
    std::string text = "'";
    for (const char c : word)
        text += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return text + "'";
}

} // namespace

std::string command_line() {
    std::ifstream words("/proc/self/cmdline");
    std::string line;
    for (std::string word; std::getline(words, word, '\0'); line += as_typed(word))
        line += line.empty() ? "" : " ";
    return line;
}

} // namespace scanshade
