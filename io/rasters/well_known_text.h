// Well-known text of coordinate systems, version 1 (OGC 01-009) and 2 (OGC 18-010): as a tree, and what units it names.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::rasters::wkt {

/// KEYWORD["text", 1.5, CHILD[...], ...]
struct Node {
    std::string keyword;             ///< in capitals
    std::vector<std::string> values; ///< texts and numbers, in order
    std::vector<Node> children;

    [[nodiscard]] const Node* child(std::initializer_list<std::string_view> keywords) const;
};

/// Throws Error that quotes the place where the text is none.
[[nodiscard]] Node parsed(std::string_view text);

/// The part with coordinates in the plane, of a compound system or of a simple one; null where there is none.
[[nodiscard]] const Node* horizontal_part(const Node& whole);
/// The part with heights; null where there is none.
[[nodiscard]] const Node* vertical_part(const Node& whole);
[[nodiscard]] bool is_geographic(const Node& system);
/// The system's own code, not those of its parts; 0 = none.
[[nodiscard]] int epsg_of(const Node& system);
/// The length of the system's unit, where it names one.
[[nodiscard]] std::optional<double> metres_in_unit(const Node& system);

} // namespace scanshade::rasters::wkt
