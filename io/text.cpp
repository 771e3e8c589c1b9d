// Files as bytes, lines and numbers: strict where std::stod and operator>> are forgiving.
#include "io/text.h"

#include "io/files.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <fmt/format.h>
#include <memory>
#include <unistd.h>

namespace scanshade {

namespace {

std::uintmax_t memory_bytes() {
    return static_cast<std::uintmax_t>(::sysconf(_SC_PHYS_PAGES)) *
           static_cast<std::uintmax_t>(::sysconf(_SC_PAGE_SIZE));
}

std::error_code last_error() { return {errno, std::generic_category()}; }

} // namespace

void fail_to_read(const std::filesystem::path& path, const std::error_code& trouble) {
    // Problems of the machine or the network, not of the file. (EIO is not among them: broken sectors stay broken.)
    constexpr std::array of_the_moment = {ESTALE,   ETIMEDOUT, ENOTCONN, EHOSTDOWN, EHOSTUNREACH,
                                          ENETDOWN, EMFILE,    ENFILE,   ENOMEM};
    const std::string what = path.string() + ": cannot be read: " + trouble.message();
    if (std::ranges::count(of_the_moment, trouble.value()) > 0)
        throw Outage(what);
    throw Error(what);
}

std::string read_bytes(const std::filesystem::path& file, std::size_t limit) {
    std::error_code trouble;
    const auto status = std::filesystem::status(file, trouble);
    if (status.type() == std::filesystem::file_type::not_found) {
        auto member = stored_in_tar(file);
        if (!member)
            throw Error(file.string() + ": no such file");
        const FileBytes bytes(file, *std::move(member));
        return bytes.bytes(0, std::min<std::uintmax_t>(bytes.size(), limit));
    }
    if (trouble)
        fail_to_read(file, trouble);
    if (!std::filesystem::is_regular_file(status))
        throw Error(file.string() + ": not a regular file");
    const auto size = std::filesystem::file_size(file, trouble);
    if (trouble)
        fail_to_read(file, trouble);

    if (std::min<std::uintmax_t>(size, limit) > memory_bytes())
        throw Error(fmt::format("{}: {} bytes, more than this machine's memory holds", file.string(), size));

    require_memory(std::min<std::uintmax_t>(size, limit), fmt::format("{}: a file of {} bytes", file.string(), size));

    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(std::fopen(file.c_str(), "rb"), &std::fclose);
    if (!stream)
        fail_to_read(file, last_error());
    std::string bytes(std::min<std::uintmax_t>(size, limit), '\0');
    bytes.resize(std::fread(bytes.data(), 1, bytes.size(), stream.get()));
    if (std::ferror(stream.get()))
        fail_to_read(file, last_error());
    return bytes;
}

std::string read_at_most(std::uintmax_t most, const std::filesystem::path& file, std::string_view what) {
    if (const auto size = size_of_file(file); size && *size > most) // read_bytes() reports that it is not there
        throw Error(fmt::format("{}: {} bytes, too large for {} (at most {})", file.string(), *size, what, most));
    return read_bytes(file);
}

std::string read_list_file(const std::filesystem::path& file) {
    constexpr std::size_t most_bytes = 1 << 28, most_lines = 1 << 22, longest_line = 1 << 13;
    std::string bytes = read_at_most(most_bytes, file, "a list");
    std::size_t lines = 0;
    for (std::size_t at = 0; at < bytes.size();) {
        const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
        if (++lines > most_lines)
            throw Error(fmt::format("{}: more than {} lines", file.string(), most_lines));
        if (end - at > longest_line)
            throw Error(fmt::format("{}: {} bytes, expected at most {} in a line of a list",
                                    at_line(file, static_cast<int>(lines)), end - at, longest_line));
        at = end + 1;
    }
    return bytes;
}

std::vector<TextLine> text_lines(std::string_view bytes) {
    constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
    if (bytes.starts_with(byte_order_mark))
        bytes.remove_prefix(byte_order_mark.size());
    std::vector<TextLine> lines;
    while (!bytes.empty()) {
        const auto end = std::min(bytes.find('\n'), bytes.size());
        std::string_view text = bytes.substr(0, end);
        if (text.ends_with('\r'))
            text.remove_suffix(1);
        lines.push_back({static_cast<int>(lines.size()) + 1, text});
        bytes.remove_prefix(std::min(end + 1, bytes.size()));
    }
    return lines;
}

namespace {
constexpr std::string_view blanks = " \t\r\n\v\f";
}

std::vector<std::string_view> words(std::string_view line) {
    std::vector<std::string_view> found;
    for (auto start = line.find_first_not_of(blanks); start != std::string_view::npos;) {
        const auto end = std::min(line.find_first_of(blanks, start), line.size());
        found.push_back(line.substr(start, end - start));
        start = line.find_first_not_of(blanks, end);
    }
    return found;
}

std::string_view trimmed(std::string_view text) {
    const auto start = text.find_first_not_of(blanks);
    if (start == std::string_view::npos)
        return {};
    return text.substr(start, text.find_last_not_of(blanks) - start + 1);
}

std::string as_utf8(std::string_view text) {
    std::string clean;
    for (std::size_t at = 0; at < text.size();) {
        const auto byte = [&](std::size_t i) {
            return static_cast<unsigned char>(at + i < text.size() ? text[at + i] : 0);
        };
        const auto follows = [&](std::size_t i) { return (byte(i) & 0xc0) == 0x80; };
        const unsigned first = byte(0), second = byte(1);
        std::size_t length = 0; // table 3-7 of the Unicode standard: no overlong forms, surrogates, or beyond 10ffff
        if (first < 0x80)
            length = 1;
        else if (first >= 0xc2 && first <= 0xdf && follows(1))
            length = 2;
        else if (first >= 0xe0 && first <= 0xef && follows(1) && follows(2) && (first != 0xe0 || second >= 0xa0) &&
                 (first != 0xed || second < 0xa0))
            length = 3;
        else if (first >= 0xf0 && first <= 0xf4 && follows(1) && follows(2) && follows(3) &&
                 (first != 0xf0 || second >= 0x90) && (first != 0xf4 || second < 0x90))
            length = 4;
        clean += length == 0 ? std::string_view("_") : text.substr(at, length);
        at += std::max<std::size_t>(length, 1);
    }
    return clean;
}

std::string in_quotes(std::string_view text) {
    constexpr std::size_t longest = 40;
    std::string clean(text.substr(0, longest));
    // Damaged files may hold control sequences, which a terminal must not get.
    std::replace_if(
        clean.begin(), clean.end(), [](char c) { return c < ' ' || c == 0x7f; }, '?');
    return '"' + clean + (text.size() > longest ? "...\"" : "\"");
}

std::optional<double> number(std::string_view word) {
    if (word.starts_with('+'))
        word.remove_prefix(1);
    double value = 0;
    const auto [end, trouble] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (end != word.data() + word.size() || word.empty())
        return std::nullopt;
    // from_chars does not say whether 1e-400 or 1e400 was met; strtod does, as 0 or infinity.
    if (trouble == std::errc::result_out_of_range)
        return std::strtod(std::string(word).c_str(), nullptr);
    if (trouble != std::errc())
        return std::nullopt;
    return value;
}

std::optional<std::uint64_t> whole_number(std::string_view word) {
    std::uint64_t value = 0;
    const auto [end, trouble] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (trouble != std::errc() || end != word.data() + word.size())
        return std::nullopt;
    return value;
}

std::string at_line(const std::filesystem::path& file, int line) {
    return fmt::format("{} line {}", file.string(), line);
}

std::string lower_extension(const std::filesystem::path& file) {
    std::string text = file.extension().string();
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return text;
}

std::string listed(const std::vector<std::string_view>& names, std::string_view before_last) {
    std::string text;
    for (std::size_t i = 0; i < names.size(); ++i)
        text += (i == 0 ? "" : i + 1 < names.size() ? ", " : fmt::format(" {} ", before_last)) + std::string(names[i]);
    return text;
}

std::string counted(std::size_t count, std::string_view noun) {
    return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

namespace {
constexpr std::size_t shown = 5;
}

void RepeatedWarning::add(std::string sentence) {
    if (++seen_ <= shown)
        warnings_.push_back(std::move(sentence));
}

RepeatedWarning::~RepeatedWarning() {
    if (seen_ > shown)
        warnings_.push_back(fmt::format("... and {} more like the last one.", seen_ - shown));
}

} // namespace scanshade
