// Values that both the manifest and `inspect --json` contain, and the reading and writing of JSON. Only declared here:
// the whole of nlohmann/json.hpp takes a compiler seconds, so that files which handle values include it themselves.
#pragma once

#include "projection/base/error.h"
#include "projection/base/parameters.h"
#include "projection/camera.h"
#include "projection/frame.h"

#include <cstddef>
#include <exception>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace scanshade {

using json = nlohmann::ordered_json;

/// fx, fy, cx, cy, width, height, distortion [k1, k2, p1, p2, k3, maybe k4, k5, k6] or fisheye [k1, k2, k3, k4] where
/// there is any, origin.
[[nodiscard]] json to_json(const Camera& camera);
/// The same with colour_from_depth, 4x4, row by row.
[[nodiscard]] json to_json(const ColourCamera& colour);

/// "yes", "no" or "unknown".
[[nodiscard]] std::string_view name_of(Registration registration);

/// The current value of a setting: a number, true, false, or text. Empty text where none is given.
[[nodiscard]] json value_json(const Parameter& row);

/// A setting: "name", "help", "default", "unit", and where there are any "low", "high", "choices".
[[nodiscard]] json parameter_json(const Parameter& row);

/// A member that counts something. Throws Error naming the key if it is not a whole number.
[[nodiscard]] std::size_t count_at(const json& object, const std::string& key);

/// To be called while an exception is handled: throws Error in place of one of JSON's, and any other again.
[[noreturn]] void rethrow_as_error();

/// during() for code that reads JSON from outside: members that are missing or of another type become Error.
template <class Action>
decltype(auto) reading_json(const std::string& what, Action&& action) {
    return during(what, [&]() -> decltype(auto) {
        try {
            return std::forward<Action>(action)();
        } catch (const std::exception&) {
            rethrow_as_error();
        }
    });
}

/// Throws what json::parse() throws.
[[nodiscard]] json parsed_json(std::string_view text);
/// A discarded value (is_discarded()) where the text is not JSON.
[[nodiscard]] json parsed_or_discarded(std::string_view text);

/// On one line; bytes that are not UTF-8 become U+FFFD.
[[nodiscard]] std::string json_line(const json& value);
/// The text as people read it; bytes that are not UTF-8 (file names may hold any) become U+FFFD.
[[nodiscard]] std::string text_of(const json& value);

} // namespace scanshade
