// The header and the XML: which scans there are, where, and how their fields are stored.
#include "io/clouds/e57/e57.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <pugixml.hpp>

namespace scanshade::e57 {

namespace {

constexpr std::uint64_t most_points = 0x7fffffff; // points are numbered with 32 bits
constexpr std::size_t most_scans = 1 << 16, most_fields = 1024;

std::uint64_t number_at(std::string_view bytes, std::size_t at) {
    std::uint64_t number = 0;
    std::memcpy(&number, bytes.data() + at, 8);
    return number;
}

/// `what` says whose number it is. No text stands for `otherwise`.
template <class Number>
Number number_of(std::string_view text, Number otherwise, const std::string& what) {
    text = trimmed(text);
    if (text.empty())
        return otherwise;
    std::string_view digits = text;
    if (digits.starts_with('+'))
        digits.remove_prefix(1);
    Number value{};
    const auto [end, failure] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (failure != std::errc() || end != digits.data() + digits.size())
        throw Error(fmt::format("{} is {}, expected a number", what, in_quotes(std::string(text.substr(0, 40)))));
    return value;
}

double finite(pugi::xml_node node, const char* child, double otherwise, const std::string& what) {
    const auto value = number_of<double>(node.child_value(child), otherwise, what + " " + child);
    if (!std::isfinite(value))
        throw Error(fmt::format("{} {} is {}, expected a finite number", what, child, value));
    return value;
}

Eigen::Isometry3d pose_of(pugi::xml_node pose, const std::string& what) {
    Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
    if (const auto rotation = pose.child("rotation")) {
        const Eigen::Quaterniond q(finite(rotation, "w", 1, what), finite(rotation, "x", 0, what),
                                   finite(rotation, "y", 0, what), finite(rotation, "z", 0, what));
        if (!(q.norm() > 1e-9 && q.norm() < 1e9))
            throw Error(fmt::format("{}: a rotation of length {}, expected 1", what, q.norm()));
        result.linear() = q.normalized().toRotationMatrix();
    }
    if (const auto translation = pose.child("translation"))
        for (int axis = 0; axis < 3; ++axis)
            result.translation()[axis] =
                finite(translation, std::array{"x", "y", "z"}[static_cast<std::size_t>(axis)], 0, what);
    return result;
}

void add_fields(pugi::xml_node structure, const std::string& what, int depth, std::vector<Field>& fields) {
    if (depth > 64)
        throw Error(what + ": more than 64 structures in each other");
    for (const pugi::xml_node node : structure.children()) {
        if (node.type() != pugi::node_element)
            continue;
        const std::string type = node.attribute("type").value(), name = node.name(),
                          whose = fmt::format("{} {}", what, name);
        if (type == "Structure") {
            add_fields(node, what, depth + 1, fields);
            continue;
        }
        Field field{.name = name};
        if (type == "Integer" || type == "ScaledInteger") {
            field.kind = type == "Integer" ? Field::Kind::integer : Field::Kind::scaled;
            field.minimum = number_of(node.attribute("minimum").value(), std::numeric_limits<std::int64_t>::min(),
                                      whose + " minimum");
            field.maximum = number_of(node.attribute("maximum").value(), std::numeric_limits<std::int64_t>::max(),
                                      whose + " maximum");
            if (field.maximum < field.minimum)
                throw Error(fmt::format("{}: minimum {} above maximum {}", whose, field.minimum, field.maximum));
        } else if (type == "Float") {
            const bool single = std::string_view(node.attribute("precision").value()) == "single";
            field.kind = single ? Field::Kind::single_float : Field::Kind::double_float;
        } else if (type == "String") {
            field.kind = Field::Kind::text;
        } else {
            throw Error(fmt::format("{} is of type {}, expected a number or text", whose, in_quotes(type)));
        }
        if (field.kind == Field::Kind::scaled) {
            field.scale = number_of(node.attribute("scale").value(), 1.0, whose + " scale");
            field.shift = number_of(node.attribute("offset").value(), 0.0, whose + " offset");
            if (!std::isfinite(field.scale) || field.scale == 0 || !std::isfinite(field.shift))
                throw Error(fmt::format("{}: scale {} and offset {}", whose, field.scale, field.shift));
        }
        fields.push_back(std::move(field));
        if (fields.size() > most_fields)
            throw Error(fmt::format("{} has more than {} fields", what, most_fields));
    }
}

std::optional<Limits> limits_of(pugi::xml_node limits, const std::string& name, const std::string& what) {
    const std::string low = name + "Minimum", high = name + "Maximum";
    if (!limits.child(low.c_str()) || !limits.child(high.c_str()))
        return std::nullopt;
    const Limits found{finite(limits, low.c_str(), 0, what), finite(limits, high.c_str(), 0, what)};
    return found.high > found.low ? std::optional(found) : std::nullopt;
}

Scan scan_of(pugi::xml_node node, std::size_t index) {
    const std::string what = fmt::format("scan {}", index);
    Scan scan;
    scan.name = node.child_value("name");
    scan.file_from_scan = pose_of(node.child("pose"), what);
    const pugi::xml_node points = node.child("points");
    if (!points)
        throw Error(what + " has no points");
    for (const pugi::xml_node codec : points.child("codecs").children())
        if (codec.type() == pugi::node_element)
            throw Error(fmt::format("{} uses codecs, only bit packing is read", what));
    scan.count = number_of<std::uint64_t>(points.attribute("recordCount").value(), 0, what + " recordCount");
    scan.section = number_of<std::uint64_t>(points.attribute("fileOffset").value(), 0, what + " fileOffset");
    if (scan.count > most_points)
        throw Error(fmt::format("{}: {} points, at most {} are read", what, scan.count, most_points));
    add_fields(points.child("prototype"), what, 0, scan.fields);
    scan.intensity = limits_of(node.child("intensityLimits"), "intensity", what);
    const pugi::xml_node colours = node.child("colorLimits"), bounds = node.child("indexBounds");
    scan.red = limits_of(colours, "colorRed", what);
    scan.green = limits_of(colours, "colorGreen", what);
    scan.blue = limits_of(colours, "colorBlue", what);
    scan.rows = limits_of(bounds, "row", what);
    scan.columns = limits_of(bounds, "column", what);
    return scan;
}

/// "image 0 "front": pinhole, 1600x1200, fx 1500 fy 1500 cx 800 cy 600, at 1.00 2.00 3.00". What is damaged of it does
/// not matter to the scans.
std::string image_text(pugi::xml_node node, std::size_t index) {
    const std::string what = fmt::format("image {}", index);
    std::string text = what;
    if (const std::string name = node.child_value("name"); !name.empty())
        text += " " + in_quotes(name);
    static constexpr std::array kinds{"pinhole", "spherical", "cylindrical", "visualReference"};
    pugi::xml_node image;
    for (const char* kind : kinds)
        if (!image && (image = node.child((std::string(kind) + "Representation").c_str())))
            text += fmt::format(": {}", kind == kinds[3] ? "without a camera" : kind);
    if (!image)
        return text + ": of an unknown kind";
    try {
        text += fmt::format(", {}x{}", number_of<std::uint64_t>(image.child_value("imageWidth"), 0, "imageWidth"),
                            number_of<std::uint64_t>(image.child_value("imageHeight"), 0, "imageHeight"));
        if (std::string_view(image.name()).starts_with(kinds[0])) {
            const double focal_m = finite(image, "focalLength", 0, what),
                         width_m = finite(image, "pixelWidth", 0, what),
                         height_m = finite(image, "pixelHeight", 0, what);
            text +=
                focal_m > 0 && width_m > 0 && height_m > 0
                    ? fmt::format(", fx {:.6g} fy {:.6g} cx {:.6g} cy {:.6g}", focal_m / width_m, focal_m / height_m,
                                  finite(image, "principalPointX", 0, what), finite(image, "principalPointY", 0, what))
                    : fmt::format(", no usable camera (focal length {} m)", focal_m);
        }
        if (const auto pose = node.child("pose")) {
            const Eigen::Vector3d at = pose_of(pose, what).translation();
            text += fmt::format(", at {:.2f} {:.2f} {:.2f}", at.x(), at.y(), at.z());
        }
    } catch (const Error& failure) {
        text += fmt::format("; damaged: {}", failure.what());
    }
    return text;
}

} // namespace

unsigned Field::bits() const {
    switch (kind) {
    case Kind::single_float:
        return 32;
    case Kind::double_float:
        return 64;
    case Kind::integer:
    case Kind::scaled:
        return static_cast<unsigned>(
            std::bit_width(static_cast<std::uint64_t>(maximum) - static_cast<std::uint64_t>(minimum)));
    case Kind::text:
        break;
    }
    return 0;
}

std::optional<std::size_t> Scan::field_named(std::string_view name_wanted) const {
    for (std::size_t i = 0; i < fields.size(); ++i)
        if (fields[i].name == name_wanted)
            return i;
    return std::nullopt;
}

Description described(std::string_view contents) {
    std::uint32_t major = 0, minor = 0;
    std::memcpy(&major, contents.data() + 8, 4);
    std::memcpy(&minor, contents.data() + 12, 4);
    if (major != 1)
        throw Error(fmt::format("E57 version {}.{}, expected 1.0", major, minor));
    const std::uint64_t said = number_at(contents, 16), length = number_at(contents, 32),
                        page = number_at(contents, 40);
    const std::uint64_t xml_in_pages = number_at(contents, 24), size = contents.size() / 1020 * 1024;
    if (page != 1024)
        throw Error(fmt::format("pages of {} bytes (byte 40), expected 1024", page));
    if (said != size)
        throw Error(fmt::format("the header says {} bytes (byte 16), the file has {}: it is cut short", said, size));
    constexpr std::uint64_t most_xml = 64 << 20;
    const std::uint64_t xml = xml_in_pages / 1024 * 1020 + xml_in_pages % 1024;
    if (xml_in_pages >= size || xml_in_pages % 1024 >= 1020 || length > contents.size() - xml || length > most_xml)
        throw Error(fmt::format("XML of {} bytes at byte {} in a file of {}", length, xml_in_pages, size));
    const std::string_view text = contents.substr(xml, length);
    if (text.find("<!DOCTYPE") != std::string_view::npos)
        throw Error("the XML declares a document type, which E57 does not have");
    pugi::xml_document document;
    if (const auto result = document.load_buffer(text.data(), text.size(), pugi::parse_default, pugi::encoding_utf8);
        !result)
        throw Error(fmt::format("XML at byte {} of {}: {}", result.offset, length, result.description()));
    const pugi::xml_node root = document.child("e57Root");
    if (!root)
        throw Error("the XML has no e57Root");
    Description found;
    for (const pugi::xml_node image : root.child("images2D").children())
        if (image.type() == pugi::node_element)
            found.images.push_back(image_text(image, found.images.size()));
    for (const pugi::xml_node scan : root.child("data3D").children()) {
        if (scan.type() != pugi::node_element)
            continue;
        if (found.scans.size() == most_scans)
            throw Error(fmt::format("more than {} scans", most_scans));
        found.scans.push_back(scan_of(scan, found.scans.size()));
    }
    return found;
}

} // namespace scanshade::e57
