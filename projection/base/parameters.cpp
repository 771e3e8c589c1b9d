#include "projection/base/parameters.h"

#include "projection/base/error.h"
#include "projection/base/nearest_word.h"

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
    throw Misuse(fmt::format("{}: '{}' given, expected {}{}", row.name, text, range.empty() ? "some text" : range,
                             suggestion(text, choices_of(row))));
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
    if (const std::optional<bool> word = switch_word(text))
        return *word;
    refuse(row, text);
}

template <>
std::string parsed<std::string>(const Parameter&, const std::string& text) {
    return text;
}

template <>
std::optional<double> parsed<std::optional<double>>(const Parameter& row, const std::string& text) {
    return text.empty() ? std::nullopt : std::optional(parsed<double>(row, text));
}

std::string choices_text(const Parameter& row) {
    std::string text;
    for (const std::string& choice : choices_of(row))
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

/// Puts the value in its place; a refused one leaves the setting as it was.
template <class Value>
void put(const Parameter& row, Value* target, Value value) {
    std::swap(*target, value);
    try {
        check(row);
    } catch (...) {
        std::swap(*target, value);
        throw;
    }
}

} // namespace

std::vector<std::string> OneOf::words() const {
    std::vector<std::string> all;
    for (std::size_t i = 0; i < count_; ++i)
        if (const std::string_view word = word_(words_, i); !word.empty())
            all.emplace_back(word);
    return all;
}

std::optional<std::string_view> OneOf::word() const {
    for (std::size_t i = 0; i < count_; ++i)
        if (holds_(variable_, words_, i))
            return word_(words_, i);
    return std::nullopt;
}

bool OneOf::set(std::string_view word) const {
    for (std::size_t i = 0; i < count_; ++i)
        if (word_(words_, i) == word) {
            assign_(variable_, words_, i);
            return true;
        }
    return false;
}

std::optional<bool> switch_word(std::string_view word) {
    constexpr std::array<std::string_view, 4> yes{"yes", "true", "on", "1"}, no{"no", "false", "off", "0"};
    if (std::ranges::count(yes, word))
        return true;
    return std::ranges::count(no, word) ? std::optional(false) : std::nullopt;
}

void set(const Parameter& row, const std::string& text) {
    std::visit(Overloaded{
                   [&](const OneOf& choice) {
                       if (!choice.set(text))
                           refuse(row, text);
                   },
                   [&]<class Value>(Value* target) { put(row, target, parsed<Value>(row, text)); },
               },
               row.value);
}

void set(const Parameter& row, double number) {
    if (float* const* const target = std::get_if<float*>(&row.value))
        put(row, *target, static_cast<float>(number));
    else
        put(row, std::get<double*>(row.value), number);
}

std::string value_text(const Parameter& row) {
    return std::visit(Overloaded{
                          [](const bool* value) { return std::string(*value ? "true" : "false"); },
                          [](const std::string* value) { return *value; },
                          [](const std::optional<double>* value) { return *value ? number_text(**value) : ""; },
                          [](const OneOf& choice) { return std::string(choice.word().value_or("")); },
                          [](const auto* value) { return number_text(*value); },
                      },
                      row.value);
}

double number_of(const Parameter& row) {
    if (float* const* const target = std::get_if<float*>(&row.value))
        return parsed<double>(row, number_text(**target));
    if (int* const* const target = std::get_if<int*>(&row.value))
        return **target;
    return *std::get<double*>(row.value);
}

std::vector<std::string> choices_of(const Parameter& row) {
    const OneOf* const choice = std::get_if<OneOf>(&row.value);
    return choice ? choice->words() : row.choices;
}

std::string range_text(const Parameter& row) {
    if (std::holds_alternative<bool*>(row.value))
        return "yes | no";
    if (std::holds_alternative<std::string*>(row.value) || std::holds_alternative<OneOf>(row.value))
        return choices_text(row);
    std::string limits = limits_text(row); // not const: it is moved out
    if (!row.unit.empty())
        return limits.empty() ? row.unit : fmt::format("{}, {}", row.unit, limits);
    if (!limits.empty())
        return limits;
    return std::holds_alternative<int*>(row.value) ? "a whole number" : "a number";
}

void check(const Parameter& row) {
    const auto within = [&](double number) { return std::isfinite(number) && number >= row.low && number <= row.high; };
    const bool good = std::visit(
        Overloaded{
            [](const bool*) { return true; },
            [&](const std::string* value) { return row.choices.empty() || std::ranges::count(row.choices, *value); },
            [](const OneOf& choice) { return choice.word().has_value(); },
            [&](const std::optional<double>* value) { return !*value || within(**value); },
            // A limit such as 0.2 is no float, and the float next to it is allowed.
            [&](const float* value) {
                return std::isfinite(*value) && *value >= static_cast<float>(row.low) &&
                       *value <= static_cast<float>(row.high);
            },
            [&](const auto* value) { return within(*value); },
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
