// One row per setting: the same rows parse the flags, print the help, check the ranges and fill the manifest.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace scanshade {

/// A value of an enum, and the word that people type for it.
template <class Enum>
struct Named {
    std::string_view name;
    Enum value;
};
template <class Enum>
Named(const char*, Enum) -> Named<Enum>;

/// The word for a value; empty where the table has none.
template <class Enum, std::size_t count>
[[nodiscard]] constexpr std::string_view word_for(Enum value, const std::array<Named<Enum>, count>& words) {
    for (const Named<Enum>& word : words)
        if (word.value == value)
            return word.name;
    return {};
}

/// A variable of an enum, bound together with a table of the words for its values. The table must outlive it.
class OneOf {
  public:
    template <class Enum, std::size_t count>
    OneOf(Enum* variable, const std::array<Named<Enum>, count>& words)
        : variable_(variable), words_(words.data()), count_(count),
          word_([](const void* table, std::size_t i) { return static_cast<const Named<Enum>*>(table)[i].name; }),
          holds_([](const void* held, const void* table, std::size_t i) {
              return *static_cast<const Enum*>(held) == static_cast<const Named<Enum>*>(table)[i].value;
          }),
          assign_([](void* held, const void* table, std::size_t i) {
              *static_cast<Enum*>(held) = static_cast<const Named<Enum>*>(table)[i].value;
          }) {}

    /// All words but the empty one, which means "not given".
    [[nodiscard]] std::vector<std::string> words() const;
    /// The word for the current value; none where the table has none.
    [[nodiscard]] std::optional<std::string_view> word() const;
    /// Sets the variable; false and no change for a word that is not in the table.
    [[nodiscard]] bool set(std::string_view word) const;

  private:
    void* variable_;
    const void* words_;
    std::size_t count_;
    std::string_view (*word_)(const void* table, std::size_t i);
    bool (*holds_)(const void* held, const void* table, std::size_t i);
    void (*assign_)(void* held, const void* table, std::size_t i);
};

/// What a command writes to the path that a setting holds.
enum class Writes { nothing, file, folder };

/// What changes with a setting: results that must then be computed anew; results, through a value that follows from it
/// and from the input (radius, camera); the files that are written of them; nothing but how a run goes.
enum class Affects { results, as_used, outputs, nothing };

/// A setting bound to the variable that holds it.
struct Parameter {
    using Target = std::variant<bool*, int*, float*, double*, std::optional<double>*, std::string*, OneOf>;

    std::string name;   ///< "radius"
    std::string help{}; ///< one line, without default and range (they are printed from the row)
    Target value;       ///< holds the default until set
    std::string unit{}; ///< "m", "rad", "" ...
    double low = -std::numeric_limits<double>::infinity(); ///< inclusive
    double high = std::numeric_limits<double>::infinity(); ///< inclusive
    std::vector<std::string> choices{};                    ///< for strings: the only values allowed; empty = any
    bool common = false;                                   ///< shown on the first page of a command's help
    Writes writes = Writes::nothing;                       ///< for strings: whether the value names an output
    Affects affects = Affects::results;
};

/// yes, true, on, 1 or no, false, off, 0; none for other words.
[[nodiscard]] std::optional<bool> switch_word(std::string_view word);
/// Sets the row's variable from text. Throws Misuse naming the row, the text, and what was expected.
void set(const Parameter& row, const std::string& text);
/// Sets a row of a real number. Throws Misuse where it is out of range.
void set(const Parameter& row, double number);
/// The row's current value as text: numbers as the shortest that round-trips, booleans "true"/"false", none if not
/// given.
[[nodiscard]] std::string value_text(const Parameter& row);
/// The current value of a numeric row as typed: 0.1 for a float that holds 0.10000000149.
[[nodiscard]] double number_of(const Parameter& row);
/// The words allowed; empty for rows of other types.
[[nodiscard]] std::vector<std::string> choices_of(const Parameter& row);
/// "m, 0 .. 100000" or "lowest | low | ..." : what may be given.
[[nodiscard]] std::string range_text(const Parameter& row);
/// Throws Misuse when the value is out of the row's range, not finite, or not among its choices.
void check(const Parameter& row);
/// The row of that name; null where there is none.
[[nodiscard]] const Parameter* row_named(const std::vector<Parameter>& rows, std::string_view name);

} // namespace scanshade
