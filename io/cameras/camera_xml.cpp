// The cameras of PCL's recordings: XML with the two roots <rgb> and <depth>, as pcl/io/lzf_image_io.h writes it.
#include "io/cameras/camera_formats.h"
#include "projection/base/error.h"

#include <algorithm>
#include <boost/property_tree/ptree.hpp>
#include <boost/property_tree/xml_parser.hpp>
#include <cmath>
#include <fmt/format.h>
#include <sstream>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using Tree = boost::property_tree::ptree;

Tree tree_of(const fs::path& file, const std::string& text) {
    // The parser recurses into what nests; PCL writes a dozen elements.
    constexpr auto most_tags = 1000;
    if (std::ranges::count(text, '<') > most_tags)
        refuse_camera(file, fmt::format("XML of more than {} tags, expected PCL's <rgb> and <depth>", most_tags));
    Tree tree;
    std::istringstream stream(text);
    try {
        boost::property_tree::read_xml(stream, tree);
    } catch (const boost::property_tree::xml_parser_error& failure) {
        throw Error(
            fmt::format("{}: {}, expected XML", at_line(file, static_cast<int>(failure.line())), failure.message()));
    }
    return tree;
}

double number_at(const fs::path& file, const Tree& tree, const std::string& key) {
    const auto text = tree.get_optional<std::string>(key);
    if (!text)
        refuse_camera(file, fmt::format("\"{}\" is missing", key));
    const auto value = number(trimmed(*text));
    if (!value || !std::isfinite(*value))
        refuse_camera(file, fmt::format("\"{}\" is {}, expected a finite number", key, in_quotes(*text)));
    return *value;
}

Pinhole pinhole_at(const fs::path& file, const Tree& tree, const std::string& root) {
    const std::array<std::string, 4> keys = {root + ".focal_length_x", root + ".focal_length_y",
                                             root + ".principal_point_x", root + ".principal_point_y"};
    const auto value = [&](std::size_t i) { return number_at(file, tree, keys[i]); };
    const Pinhole pinhole{value(0), value(1), value(2), value(3), {}}; // PCL's pixel centres are integers, too
    check_numbers(file, pinhole, keys);
    return pinhole;
}

bool same_numbers(const Pinhole& a, const Pinhole& b) {
    return a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy;
}

} // namespace

CameraFile camera_from_xml(const fs::path& file, const std::string& text) {
    const Tree tree = tree_of(file, text);
    CameraFile result;
    result.camera.pinhole = pinhole_at(file, tree, "depth");
    const std::string unit = "depth.z_multiplication_factor";
    if (tree.get_child_optional(unit)) {
        const double metres = number_at(file, tree, unit), units = 1 / metres;
        if (!(metres > 0 && std::isfinite(units)))
            refuse_camera(file, fmt::format("\"{}\" is {}, expected metres per stored unit", unit, metres));
        result.depth_units_per_metre = units;
    }
    // Registered depth has the colour camera's numbers. But equal numbers do not prove that depth is registered.
    if (tree.get_child_optional("rgb") && !same_numbers(pinhole_at(file, tree, "rgb"), result.camera.pinhole))
        result.registration = Registration::no;
    return result;
}

} // namespace scanshade
