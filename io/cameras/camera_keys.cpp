// Cameras as lines of a key and a number, as many programs write them: settings of ORB-SLAM, INI files, tables.
#include "io/cameras/camera_formats.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

struct KeyLine {
    std::string key;   ///< lower case, without "Camera." and the like
    std::string value; ///< lower case, without quotes
};

std::string lower(std::string_view text) {
    std::string result(text);
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
    return std::ranges::any_of(lines, [](const TextLine& line) {
        const auto found = key_line(line.text);
        return found && found->key == "fx" && number(found->value);
    });
}

CameraFile camera_from_lines(const fs::path& file, const std::vector<TextLine>& lines) {
    nlohmann::json object = nlohmann::json::object();
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
            const auto value = number(found->value);
            object[found->key] = value ? nlohmann::json(*value) : nlohmann::json(found->value);
        }
    }
    if (!section.empty())
        refuse_sections(file, section, object);
    return camera_from_keys(file, object);
}

} // namespace scanshade
