// PCL's recordings: for each instant TIME_depth.pclzf, TIME_rgb.pclzf and their cameras in TIME.xml, as its viewers
// write them and its ImageGrabber reads them.
#include "io/captures/listing/layouts.h"

#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <chrono>
#include <fmt/format.h>
#include <map>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

struct Shot {
    fs::path depth, colour;
};
using Shots = std::map<std::string, Shot, decltype(&natural_less)>;

/// "frame_TIME_depth.pclzf" -> "frame_TIME" and "depth"; nothing for other names.
std::optional<std::pair<std::string, std::string>> shot_part(const fs::path& file) {
    const std::string stem = file.stem().string();
    const auto before_part = stem.rfind('_');
    if (lower_extension(file) != ".pclzf" || before_part == std::string::npos || before_part == 0)
        return std::nullopt;
    return std::pair(stem.substr(0, before_part), stem.substr(before_part + 1));
}

/// Seconds of "20121214T142255.814212" (ISO 8601, local time, counted here as UTC) after the last "_" of the name.
std::optional<double> stamp_in(const std::string& name) {
    const std::string_view stamp = std::string_view(name).substr(name.rfind('_') + 1);
    constexpr std::size_t whole_seconds = 15;
    const auto digits = [&](std::size_t at, std::size_t count) {
        const auto value = stamp.size() >= whole_seconds ? whole_number(stamp.substr(at, count)) : std::nullopt;
        return value ? static_cast<int>(*value) : -1;
    };
    const std::chrono::year_month_day day{std::chrono::year(digits(0, 4)),
                                          std::chrono::month(static_cast<unsigned>(digits(4, 2))),
                                          std::chrono::day(static_cast<unsigned>(digits(6, 2)))};
    const int hour = digits(9, 2), minute = digits(11, 2), second = digits(13, 2);
    const bool sound = day.ok() && stamp[8] == 'T' && hour >= 0 && hour < 24 && minute >= 0 && minute < 60 &&
                       second >= 0 && second <= 60;
    const std::string_view rest = sound ? stamp.substr(whole_seconds) : "";
    const auto fraction = rest.empty() ? std::optional(0.0) : number(fmt::format("0{}", rest));
    if (!sound || !fraction || !(*fraction >= 0 && *fraction < 1))
        return std::nullopt;
    const std::chrono::days since_1970 = std::chrono::sys_days(day).time_since_epoch();
    return static_cast<double>(std::chrono::seconds(since_1970).count() + hour * 3600 + minute * 60 + second) +
           *fraction;
}

CaptureEntry shot_entry(const std::string& name, const Shot& shot, bool colours) {
    CaptureEntry entry;
    entry.name = name;
    entry.depth = shot.depth;
    entry.colour = shot.colour;
    entry.stamp_s = stamp_in(name);
    if (!shot.colour.empty())
        entry.colour_stamp_s = entry.stamp_s;
    if (shot.depth.empty())
        entry.problem = fmt::format("{} does not exist, though {} does",
                                    (shot.colour.parent_path() / (name + "_depth.pclzf")).string(),
                                    shot.colour.filename().string());
    else if (colours && shot.colour.empty())
        entry.warnings.push_back(fmt::format("{} has no colour image.", shot.depth.filename().string()));
    return entry;
}

bool same(const CameraFile& a, const CameraFile& b) {
    const Pinhole &p = a.camera.pinhole, &q = b.camera.pinhole;
    return p.fx == q.fx && p.fy == q.fy && p.cx == q.cx && p.cy == q.cy && a.registration == b.registration &&
           a.depth_units_per_metre == b.depth_units_per_metre;
}

/// The camera in the first readable XML file. Others that differ or cannot be read give a warning.
std::optional<CameraFile> recorded_camera(const Shots& shots, std::vector<std::string>& warnings) {
    std::optional<CameraFile> first;
    RepeatedWarning trouble(warnings);
    for (const auto& [name, shot] : shots) {
        try {
            const auto camera = camera_beside_pclzf(shot.depth);
            if (!first)
                first = camera;
            else if (camera && !same(*camera, *first))
                trouble.add(fmt::format("{} has another camera than {}, whose camera is used for all frames.",
                                        camera->camera.origin, first->camera.origin));
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) {
            trouble.add(fmt::format("{}; not used.", failure.what()));
        }
    }
    return first;
}

} // namespace

std::optional<CameraFile> camera_beside_pclzf(const fs::path& depth) {
    const auto name_and_part = shot_part(depth);
    if (!name_and_part || name_and_part->second != "depth")
        return std::nullopt;
    const fs::path file = depth.parent_path() / (name_and_part->first + ".xml");
    return is_file(file) ? std::optional(read_camera_file(file)) : std::nullopt;
}

std::optional<Listing> list_pcl_recording(const fs::path& folder) {
    Shots shots(&natural_less);
    bool any_depth = false, any_colour = false;
    std::vector<std::string> others;
    for (const fs::path& file : files_in(folder)) {
        const auto name_and_part = shot_part(file);
        if (name_and_part && name_and_part->second == "depth")
            shots[name_and_part->first].depth = file, any_depth = true;
        else if (name_and_part && name_and_part->second == "rgb")
            shots[name_and_part->first].colour = file, any_colour = true;
        else if (has_depth_extension(file) || has_colour_extension(file))
            others.push_back(file.filename().string());
    }
    if (!any_depth)
        return std::nullopt;
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = usual_encoding("mm", "PCL's default");
    capture.registration_reason = "PCL's files do not say whether depth was registered to colour";
    for (const auto& [name, shot] : shots)
        capture.entries.push_back(shot_entry(name, shot, any_colour));
    if (!others.empty())
        capture.warnings.push_back(fmt::format("{}: {} left out, beside TIME_depth.pclzf and TIME_rgb.pclzf ({}{}).",
                                               folder.string(), counted(others.size(), "image"), others.front(),
                                               others.size() > 1 ? ", ..." : ""));
    const auto recorded = recorded_camera(shots, capture.warnings);
    if (recorded && recorded->depth_units_per_metre) // also where the camera comes from elsewhere
        capture.depth = depth_encoding(fmt::format("{}", *recorded->depth_units_per_metre), recorded->camera.origin);
    listing.find_camera = [folder, recorded](cv::Size, std::vector<std::string>& warnings) {
        const auto placed = camera_in(folder, warnings); // placed by the user
        return placed ? placed : recorded;
    };
    return listing;
}

} // namespace scanshade
