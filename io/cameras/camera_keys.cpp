// Cameras as lines of a key and a number, as many programs write them: settings of ORB-SLAM, INI files, tables.
#include "io/cameras/camera_formats.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <utility>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

struct KeyLine {
    std::string key;   ///< lower case, without "Camera." and the like
    std::string value; ///< lower case, without quotes
};

/// In lower case, as JSON can hold it.
std::string lower(std::string_view text) {
    std::string result = as_utf8(text);
    std::ranges::transform(result, result.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return result;
}

/// "Camera1.fx: 525.0 # of depth": fx, 525.0.
std::optional<KeyLine> key_line(std::string_view line) {
    line = trimmed(line.substr(0, line.find('#')));
    if (line.starts_with('%')) // %YAML
        return std::nullopt;
    const std::size_t between = line.find_first_of("=:,");
    const std::size_t end = between == std::string_view::npos ? line.find_last_of(" \t") : between;
    if (end == std::string_view::npos || end == 0)
        return std::nullopt;
    std::string key = lower(trimmed(line.substr(0, end))), value = lower(trimmed(line.substr(end + 1)));
    std::erase(value, '"');
    std::erase(key, '"');
    for (const char* prefix : {"camera.", "camera1.", "cam.", "rgbd."})
        if (key.starts_with(prefix))
            key = key.substr(std::string_view(prefix).size());
    struct Name {
        const char *theirs, *ours;
    };
    constexpr std::array names{Name{"image_width", "width"},  Name{"image_height", "height"},
                               Name{"resolution x", "width"}, Name{"resolution y", "height"},
                               Name{"type", "camera_model"},  Name{"distortion", "distortion_model"}};
    const auto* const found = std::ranges::find_if(names, [&](const Name& name) { return key == name.theirs; });
    return KeyLine{found == names.end() ? key : found->ours, value};
}

using Pairs = std::vector<std::pair<std::string, double>>;

/// "fx=140, fy=140, cx=79.5, cy=59.5", also as Python prints a dictionary: all of one line. Nothing for other lines.
Pairs pairs_of(std::string_view line) {
    std::string plain = lower(line);
    std::ranges::replace_if(
        plain, [](char c) { return std::string_view("=:,;{}'\"()").find(c) != std::string_view::npos; }, ' ');
    const auto all = words(plain);
    Pairs pairs;
    for (std::size_t i = 0; i + 1 < all.size(); i += 2) {
        const auto value = number(all[i + 1]);
        if (!value || number(all[i]))
            return {};
        pairs.emplace_back(all[i], *value);
    }
    constexpr std::size_t of_a_camera = 4;
    return pairs.size() >= of_a_camera && all.size() % 2 == 0 ? pairs : Pairs();
}

/// A line of names and one of as many numbers below it, as of a table.
Pairs pairs_of(std::string_view names, std::string_view values) {
    const auto cells = [](std::string_view line) {
        std::string text = lower(line.substr(std::min(line.find_first_not_of("#/ \t"), line.size())));
        std::ranges::replace_if(
            text, [](char c) { return c == ',' || c == ';' || c == '"'; }, ' ');
        return text;
    };
    const std::string above = cells(names), below = cells(values);
    const auto keys = words(above), all = words(below);
    Pairs pairs;
    for (std::size_t i = 0; i < keys.size() && keys.size() == all.size(); ++i) {
        const auto value = number(all[i]);
        if (!value || number(keys[i]))
            return {};
        pairs.emplace_back(keys[i], *value);
    }
    return pairs;
}

/// "[ 640x480  p[319.5 239.5]  f[600 600]  Brown Conrady [0 0 0 0 0] ]", as librealsense prints intrinsics.
Pairs pairs_of_librealsense(std::string_view line) {
    const auto behind = [&](std::string_view mark) {
        const std::size_t at = line.find(mark);
        const std::size_t begin = at == std::string_view::npos ? line.size() : at + mark.size();
        std::vector<double> values;
        for (const auto word : words(line.substr(begin, line.find(']', begin) - begin)))
            values.push_back(number(word).value_or(std::nan("")));
        return values;
    };
    const auto principal = behind(" p["), focal = behind(" f["), lens = behind("onrady [");
    if (principal.size() != 2 || focal.size() != 2)
        return {};
    Pairs pairs{{"fx", focal[0]}, {"fy", focal[1]}, {"cx", principal[0]}, {"cy", principal[1]}};
    for (const auto word : words(line))
        if (const std::size_t by = word.find('x'); by != std::string_view::npos)
            if (const auto width = whole_number(word.substr(0, by)), height = whole_number(word.substr(by + 1));
                width && height) {
                pairs.emplace_back("width", *width);
                pairs.emplace_back("height", *height);
            }
    constexpr std::array names{"k1", "k2", "p1", "p2", "k3"};
    for (std::size_t i = 0; i < names.size() && lens.size() == names.size(); ++i)
        pairs.emplace_back(names[i], lens[i]);
    return pairs;
}

bool have_focal_length(const Pairs& pairs) { return std::ranges::count(pairs, "fx", &Pairs::value_type::first) == 1; }

/// A whole camera in one line, or in two; nothing where each line holds one number.
Pairs in_few_lines(const std::vector<TextLine>& lines) {
    for (std::size_t i = 0; i < lines.size(); ++i) {
        for (const Pairs& pairs : {pairs_of(lines[i].text), pairs_of_librealsense(lines[i].text),
                                   i + 1 < lines.size() ? pairs_of(lines[i].text, lines[i + 1].text) : Pairs()})
            if (have_focal_length(pairs))
                return pairs;
    }
    return {};
}

/// One number, or several between blanks.
nlohmann::json value_of(const std::string& text) {
    nlohmann::json values = nlohmann::json::array();
    for (const auto word : words(text)) {
        const auto value = number(word);
        if (!value)
            return text;
        values.push_back(*value);
    }
    return values.size() == 1 ? values[0] : values.empty() ? nlohmann::json(text) : values;
}

/// "[LEFT_CAM_VGA]": LEFT_CAM_VGA.
std::string section_of(std::string_view line) {
    line = trimmed(line);
    return line.starts_with('[') && line.ends_with(']') ? std::string(line.substr(1, line.size() - 2)) : "";
}

[[noreturn]] void refuse_sections(const fs::path& file, const std::string& section, const nlohmann::json& camera) {
    const auto value = [&](const char* key) { return camera.contains(key) ? camera[key].dump() : "?"; };
    refuse_camera(file, fmt::format("an INI file, as of ZED cameras, with a camera for each section: none is chosen. "
                                    "[{}] would be --camera {},{},{},{}",
                                    section, value("fx"), value("fy"), value("cx"), value("cy")));
}

} // namespace

bool has_camera_keys(const std::vector<TextLine>& lines) {
    return !in_few_lines(lines).empty() || std::ranges::any_of(lines, [](const TextLine& line) {
        const auto found = key_line(line.text);
        return found && found->key == "fx" && number(found->value);
    });
}

CameraFile camera_from_lines(const fs::path& file, const std::vector<TextLine>& lines) {
    nlohmann::json object = nlohmann::json::object();
    std::vector<std::string> warnings;
    if (const Pairs pairs = in_few_lines(lines); !pairs.empty()) {
        for (const auto& [key, value] : pairs)
            object[key] = value;
        return camera_from_keys(file, in_our_words(file, object, warnings));
    }
    std::string section;
    for (const TextLine& line : lines) {
        if (const std::string next = section_of(line.text); !next.empty()) {
            if (object.contains("fx"))
                break;
            section = next;
            object.clear();
        } else if (const auto found = key_line(line.text)) {
            if (found->key == "fx" && object.contains("fx"))
                throw Error(fmt::format("{}: {} is there twice", at_line(file, line.number), in_quotes(found->key)));
            object[found->key] = value_of(found->value);
        }
    }
    if (!section.empty())
        refuse_sections(file, section, object);
    return camera_from_keys(file, in_our_words(file, object, warnings));
}

} // namespace scanshade
