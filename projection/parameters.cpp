#include "projection/parameters.h"

#include "projection/error.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <type_traits>

namespace scanshade {
namespace {

template <class... Cases>
struct Overloaded : Cases... {
    using Cases::operator()...;
};
template <class... Cases>
Overloaded(Cases...) -> Overloaded<Cases...>;

/// Shortest text that reads back the same; whole numbers without an exponent (100000, not 1e+05).
template <class Number>
std::string number_text(Number number) {
    std::array<char, 64> buffer;
    char *begin = buffer.data(), *end = begin + buffer.size();
    if constexpr (std::is_floating_point_v<Number>)
        if (std::abs(number) < Number(1e15) && number == std::trunc(number))
            return {begin, std::to_chars(begin, end, number, std::chars_format::fixed).ptr};
    return {begin, std::to_chars(begin, end, number).ptr};
}

[[noreturn]] void refuse(const Parameter& row, const std::string& text) {
    const std::string range = range_text(row);
    throw Misuse(fmt::format("{}: '{}' given, expected {}", row.name, text, range.empty() ? "some text" : range));
}

template <class Number>
Number parsed(const Parameter& row, const std::string& text) {
    Number number{};
    const char* end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, number);
    if (error != std::errc() || stop != end)
        refuse(row, text);
    return number;
}

template <>
bool parsed<bool>(const Parameter& row, const std::string& text) {
    for (const char* yes : {"true", "1", "on", "yes"})
        if (text == yes)
            return true;
    for (const char* no : {"false", "0", "off", "no"})
        if (text == no)
            return false;
    refuse(row, text);
}

template <>
std::string parsed<std::string>(const Parameter&, const std::string& text) {
    return text;
}

std::string choices_text(const Parameter& row) {
    std::string text;
    for (const std::string& choice : row.choices)
        text += (text.empty() ? "" : " | ") + choice;
    return text;
}

std::string limits_text(const Parameter& row) {
    const bool above = std::isfinite(row.low), below = std::isfinite(row.high);
    if (above && below)
        return fmt::format("{} .. {}", number_text(row.low), number_text(row.high));
    if (above)
        return fmt::format("{} or more", number_text(row.low));
    return below ? fmt::format("{} or less", number_text(row.high)) : std::string();
}

} // namespace

void set(const Parameter& row, const std::string& text) {
    std::visit(
        [&](auto* target) {
            using Value = std::remove_pointer_t<decltype(target)>;
            Value value = parsed<Value>(row, text);
            std::swap(*target, value);
            try {
                check(row);
            } catch (...) {
                std::swap(*target, value); // a refused text leaves the setting as it was
                throw;
            }
        },
        row.value);
}

std::string value_text(const Parameter& row) {
    return std::visit(Overloaded{
                          [](const bool* value) { return std::string(*value ? "true" : "false"); },
                          [](const std::string* value) { return *value; },
                          [](const auto* value) { return number_text(*value); },
                      },
                      row.value);
}

std::string range_text(const Parameter& row) {
    if (std::holds_alternative<bool*>(row.value))
        return "true | false";
    if (std::holds_alternative<std::string*>(row.value))
        return choices_text(row);
    const std::string limits = limits_text(row);
    if (!row.unit.empty())
        return limits.empty() ? row.unit : fmt::format("{}, {}", row.unit, limits);
    if (!limits.empty())
        return limits;
    return std::holds_alternative<int*>(row.value) ? "a whole number" : "a number";
}

void check(const Parameter& row) {
    const bool good = std::visit(Overloaded{
                                     [](const bool*) { return true; },
                                     [&](const std::string* value) {
                                         return row.choices.empty() || std::find(row.choices.begin(), row.choices.end(),
                                                                                 *value) != row.choices.end();
                                     },
                                     [&](const auto* value) {
                                         const double number = *value;
                                         return std::isfinite(number) && number >= row.low && number <= row.high;
                                     },
                                 },
                                 row.value);
    if (!good)
        refuse(row, value_text(row));
}

const Parameter* row_named(const std::vector<Parameter>& rows, std::string_view name) {
    const auto row = std::ranges::find(rows, name, &Parameter::name);
    return row == rows.end() ? nullptr : &*row;
}

} // namespace scanshade
