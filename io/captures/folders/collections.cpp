// Collections of rooms: SUN RGB-D, a folder for each image, and NYU depth v2 as it was recorded.
#include "io/captures/listing/layouts.h"

#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

// --- SUN RGB-D: image/, depth/, intrinsics.txt ---

std::optional<Listing> list_sun_rgbd(const fs::path& folder) {
    const fs::path file = folder / "intrinsics.txt";
    const auto depths = depth_images_in(folder_named(folder, {"depth"})),
               images = colour_images_in(folder_named(folder, {"image"}));
    if (depths.size() != 1 || images.size() != 1 || !is_file(file))
        return std::nullopt;
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = usual_encoding("sun", "SUN RGB-D layout");
    capture.registration = Registration::yes;
    capture.registration_reason = "SUN RGB-D's colour and depth are registered";
    CaptureEntry entry;
    entry.name = depths[0].stem().string();
    entry.depth = depths[0];
    entry.colour = images[0];
    capture.entries.push_back(std::move(entry));
    listing.find_camera = [file, image = images[0]](cv::Size size,
                                                    std::vector<std::string>&) -> std::optional<CameraFile> {
        try { // it is for the image and its depth alike
            size = peek(image).size;
        } catch (const Outage&) {
            throw;
        } catch (const Error&) { // loading it will say why
        }
        const std::string bytes = read_list_file(file); // nine numbers, in one line or three
        std::vector<double> k;
        for (const std::string_view word : words(bytes))
            if (const auto value = number(word); value && std::isfinite(*value))
                k.push_back(*value);
        if (k.size() != 9)
            throw Error(fmt::format("{}: {}, expected 9 of a 3x3 matrix", file.string(), counted(k.size(), "number")));
        return CameraFile{{{k[0], k[4], k[2], k[5], size}, {}, file.string()}, {}, Registration::unknown, {}};
    };
    return listing;
}

// --- NYU depth v2, raw: d-SECONDS-TICKS.pgm, r-SECONDS-TICKS.ppm ---

namespace {

/// "d-1305031110.112000-2996770081" -> 1305031110.112
std::optional<double> nyu_seconds(const fs::path& file, char kind) {
    const std::string name = file.stem().string();
    const std::size_t end = name.find('-', 2);
    if (name.size() < 4 || name[0] != kind || name[1] != '-' || end == std::string::npos)
        return std::nullopt;
    return number(name.substr(2, end - 2));
}

} // namespace

std::optional<Listing> list_nyu_raw(const fs::path& folder) {
    std::vector<std::pair<double, fs::path>> depths, colours;
    for (const fs::path& file : files_in(folder)) {
        const std::string extension = lower_extension(file);
        if (const auto seconds = nyu_seconds(file, 'd'); seconds && extension == ".pgm")
            depths.emplace_back(*seconds, file);
        else if (const auto of_colour = nyu_seconds(file, 'r'); of_colour && extension == ".ppm")
            colours.emplace_back(*of_colour, file);
    }
    if (depths.empty())
        return std::nullopt;
    std::ranges::sort(depths);
    constexpr double together_s = 0.05;
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = usual_encoding("nyu", "NYU layout");
    capture.registration = Registration::no;
    capture.registration_reason = "a camera of its own took the colour";
    for (const auto& [seconds, depth] : depths) {
        CaptureEntry entry;
        entry.name = depth.stem().string();
        entry.depth = depth;
        entry.stamp_s = seconds;
        const auto apart = [at = seconds](const auto& colour) { return std::abs(colour.first - at); };
        const auto nearest = std::ranges::min_element(colours, {}, apart);
        if (nearest != colours.end() && apart(*nearest) <= together_s) {
            entry.colour = nearest->second;
            entry.colour_stamp_s = nearest->first;
        }
        capture.entries.push_back(std::move(entry));
    }
    listing.find_camera = [](cv::Size size, std::vector<std::string>& warnings) -> std::optional<CameraFile> {
        if (size.empty() || 3 * size.width != 4 * size.height)
            return std::nullopt;
        CameraFile camera = camera_from_argument("nyu-depth");
        camera.camera.pinhole = scaled(camera.camera.pinhole, size);
        warnings.push_back("no camera file; NYU's published depth camera is assumed.");
        return camera;
    };
    return listing;
}

} // namespace scanshade
