// Cameras in XML: those of PCL's recordings, with the two roots <rgb> and <depth>, as pcl/io/lzf_image_io.h writes it,
// and OpenCV's.
#include "io/cameras/camera_formats.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pugixml.hpp>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

double number_at(const fs::path& file, const pugi::xml_node& group, const std::string& key) {
    const std::string name = fmt::format("\"{}.{}\"", group.name(), key);
    const pugi::xml_node element = group.child(key.c_str());
    if (!element)
        refuse_camera(file, name + " is missing");
    const std::string_view text = element.child_value();
    const auto value = number(trimmed(text));
    if (!value || !std::isfinite(*value))
        refuse_camera(file, fmt::format("{} is {}, expected a finite number", name, in_quotes(text)));
    return *value;
}

Pinhole pinhole_of(const fs::path& file, const pugi::xml_node& group) {
    const std::array<std::string, 4> keys = {"focal_length_x", "focal_length_y", "principal_point_x",
                                             "principal_point_y"};
    const auto value = [&](std::size_t i) { return number_at(file, group, keys[i]); };
    const Pinhole pinhole{value(0), value(1), value(2), value(3), {}}; // PCL's pixel centres are integers, too
    std::array<std::string, 4> names;
    std::ranges::transform(keys, names.begin(), [&](const std::string& key) { return group.name() + ("." + key); });
    check_numbers(file, pinhole, names);
    return pinhole;
}

bool same_numbers(const Pinhole& a, const Pinhole& b) {
    return a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy;
}

/// OpenCV writes the same in XML and in YAML: a matrix is an element whose <data> are numbers between blanks.
std::string as_yaml(const pugi::xml_node& storage) {
    std::string yaml;
    const auto quoted = [](std::string_view word) {
        std::string text(word);
        std::erase_if(text, [](char c) { return c == '"' || c == '\\'; });
        return '"' + text + '"';
    };
    for (const pugi::xml_node& element : storage.children()) {
        const pugi::xml_node data = element.child("data");
        const std::string_view text = data ? data.child_value() : element.child_value();
        std::vector<std::string> values;
        std::string line(text);
        std::ranges::replace_if(
            line, [](unsigned char c) { return std::isspace(c) != 0; }, ' ');
        for (const std::string_view word : words(line))
            values.push_back(quoted(word));
        if (data)
            yaml += fmt::format("{}: [{}]\n", quoted(element.name()), fmt::join(values, ", "));
        else if (values.size() == 1)
            yaml += fmt::format("{}: {}\n", quoted(element.name()), values[0]);
    }
    return yaml;
}

} // namespace

CameraFile camera_from_xml(const fs::path& file, const std::string& text) {
    pugi::xml_document document;
    if (const auto parsed = document.load_buffer(text.data(), text.size()); !parsed) {
        const auto line =
            1 + std::ranges::count(std::string_view(text).substr(0, static_cast<std::size_t>(parsed.offset)), '\n');
        throw Error(fmt::format("{}: {}, expected XML", at_line(file, static_cast<int>(line)), parsed.description()));
    }
    if (const pugi::xml_node storage = document.child("opencv_storage"))
        return camera_from_yaml(file, as_yaml(storage));
    const pugi::xml_node depth = document.child("depth"), rgb = document.child("rgb");
    if (!depth)
        refuse_camera(
            file,
            fmt::format(
                "\"depth\" is missing in XML of <{}>: expected OpenCV's <opencv_storage>, or PCL's <rgb> and <depth>",
                document.document_element().name()));
    CameraFile result;
    result.camera.pinhole = pinhole_of(file, depth);
    const char* const unit = "z_multiplication_factor";
    if (depth.child(unit)) {
        const double metres = number_at(file, depth, unit), units = 1 / metres;
        if (!(metres > 0 && std::isfinite(units)))
            refuse_camera(file, fmt::format("\"depth.{}\" is {}, expected metres per stored unit", unit, metres));
        result.depth_units_per_metre = units;
    }
    // Registered depth has the colour camera's numbers. But equal numbers do not prove that depth is registered.
    if (rgb && !same_numbers(pinhole_of(file, rgb), result.camera.pinhole))
        result.registration = Registration::no;
    return result;
}

} // namespace scanshade
