// Files as bytes, lines and numbers, each number checked; the base of every text reader of io.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace scanshade {

/// Throws Error that `path` cannot be read, or Outage for a temporary problem of machine or network.
[[noreturn]] void fail_to_read(const std::filesystem::path& path, const std::error_code& trouble);
/// The whole file, or its first `limit` bytes. Throws Error naming the file when it is missing, a folder, or
/// unreadable, or larger than the machine's memory; Outage as fail_to_read().
[[nodiscard]] std::string read_bytes(const std::filesystem::path& file, std::size_t limit = SIZE_MAX);
/// The whole file. Throws Error, too, where it is larger than `most` bytes, before it is read: "too large for `what`".
[[nodiscard]] std::string read_at_most(std::uintmax_t most, const std::filesystem::path& file, std::string_view what);
/// A whole file of lines that fit into a vector: a list, a trajectory. Throws Error, too, for more than 2^28 bytes or
/// 2^22 lines, or a line of more than 2^13 bytes: that is another kind of file.
[[nodiscard]] std::string read_list_file(const std::filesystem::path& file);

/// One line of a text file without its line end; numbers start at 1.
struct TextLine {
    int number = 0;
    std::string_view text;
};

/// All lines, blank ones too. A UTF-8 byte order mark and carriage returns are left out.
/// The views point into `bytes`, which must outlive them.
[[nodiscard]] std::vector<TextLine> text_lines(std::string_view bytes);

/// The words of a line: split at blanks and tabs.
[[nodiscard]] std::vector<std::string_view> words(std::string_view line);
/// Without blanks at either end.
[[nodiscard]] std::string_view trimmed(std::string_view text);
/// With "_" for every byte that is no part of UTF-8: JSON can hold and read back the result.
[[nodiscard]] std::string as_utf8(std::string_view text);
/// A word or line cut and cleaned for quoting in a message.
[[nodiscard]] std::string in_quotes(std::string_view text);

/// The number that is the whole word; "nan" and "inf" are numbers too. Nothing when it is anything else.
[[nodiscard]] std::optional<double> number(std::string_view word);
/// A non-negative integer, digits only, below 2^64.
[[nodiscard]] std::optional<std::uint64_t> whole_number(std::string_view word);

/// "path line 12": how every message names a place in a text file.
[[nodiscard]] std::string at_line(const std::filesystem::path& file, int line);

/// ".PNG" -> ".png"
[[nodiscard]] std::string lower_extension(const std::filesystem::path& file);

/// "a, b or c", with the word before the last.
[[nodiscard]] std::string listed(const std::vector<std::string_view>& names, std::string_view before_last);

/// "1 point", "7 points"
[[nodiscard]] std::string counted(std::size_t count, std::string_view noun);

/// Appends to `warnings` the first few of many alike, and how many more there were.
class RepeatedWarning {
  public:
    explicit RepeatedWarning(std::vector<std::string>& warnings) : warnings_(warnings) {}
    ~RepeatedWarning();
    RepeatedWarning(const RepeatedWarning&) = delete;
    RepeatedWarning& operator=(const RepeatedWarning&) = delete;
    void add(std::string sentence);

  private:
    std::vector<std::string>& warnings_;
    std::size_t seen_ = 0;
};

} // namespace scanshade
