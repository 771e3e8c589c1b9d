// JSON from outside with limited depth: printing and copying it recurse, and could overflow the stack.
#pragma once

#include "projection/base/error.h"

#include <fmt/format.h>
#include <string>
#include <string_view>
#include <utility>

namespace scanshade {

inline constexpr int deepest_json = 64;

/// What was wrong, for people: the JSON library's number of its exception and its text -> a sentence of ours.
[[nodiscard]] std::string json_problem(int id, std::string_view text);

/// Json::parse(text), `text` being a string or a stream. Throws what it throws, and Error where values nest deeper than
/// deepest_json.
template <class Json, class Text>
[[nodiscard]] Json shallow_json(Text&& text) {
    return Json::parse(std::forward<Text>(text), [](int depth, auto, auto&) {
        if (depth > deepest_json)
            throw Error(fmt::format("JSON nested deeper than {} levels", deepest_json));
        return true;
    });
}

} // namespace scanshade
