// JSON from outside with limited depth: printing and copying it recurse, and could overflow the stack.
#pragma once

#include "projection/base/error.h"

#include <fmt/format.h>
#include <utility>

namespace scanshade {

inline constexpr int deepest_json = 64;

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
