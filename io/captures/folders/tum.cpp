// The TUM RGB-D layout (Sturm et al., IROS 2012): depth.txt, rgb.txt and groundtruth.txt, paired by nearest time.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/files.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <tuple>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

struct ListedImage {
    double stamp_s = 0;
    std::string stamp, name; ///< as the list writes them
    int line = 0;
};

// --- lists ---

void sort_by_time(std::vector<ListedImage>& images, const fs::path& list, std::vector<std::string>& warnings) {
    const auto earlier = [](const ListedImage& a, const ListedImage& b) { return a.stamp_s < b.stamp_s; };
    if (!std::is_sorted(images.begin(), images.end(), earlier)) {
        warnings.push_back(list.string() + ": time stamps are out of order; sorted.");
        std::stable_sort(images.begin(), images.end(), earlier);
    }
    RepeatedWarning repeated(warnings);
    for (std::size_t i = 1; i < images.size(); ++i)
        if (images[i].stamp_s == images[i - 1].stamp_s)
            repeated.add(fmt::format("{}: repeats the time stamp {} of line {}; each image is used once at most.",
                                     at_line(list, images[i].line), images[i].stamp, images[i - 1].line));
}

/// "time file name" per line; unusable lines are left out with a warning.
std::vector<ListedImage> read_list(const fs::path& list, std::vector<std::string>& warnings) {
    const std::string bytes = read_list_file(list);
    std::vector<ListedImage> images;
    RepeatedWarning left_out(warnings);
    bool first = true;
    for (const TextLine& line : text_lines(bytes)) {
        const std::string_view text = trimmed(line.text);
        if (text.empty() || text.starts_with('#'))
            continue;
        const std::string_view stamp_word = words(text).front();
        const std::string_view name = trimmed(text.substr(stamp_word.size()));
        const auto stamp = number(stamp_word);
        const auto at = at_line(list, line.number);
        const bool header = std::exchange(first, false) && !stamp;
        if (header)
            warnings.push_back(at + ": no time stamp; taken as a header that lacks its \"#\".");
        else if (!stamp || !std::isfinite(*stamp))
            left_out.add(fmt::format("{}: {} is no time stamp; line not used.", at, in_quotes(stamp_word)));
        else if (name.empty())
            left_out.add(at + ": no file name after the time stamp; line not used.");
        else
            images.push_back({*stamp, std::string(stamp_word), std::string(name), line.number});
    }
    sort_by_time(images, list, warnings);
    return images;
}

// --- pairing ---

/// For each depth image the colour image nearest in time, each used once at most: the closest pair first, ties in list
/// order.
std::vector<std::optional<std::size_t>> pair_by_time(const std::vector<ListedImage>& depths,
                                                     const std::vector<ListedImage>& colours, double limit_s) {
    // If many images are within a generous limit, the nearest on either side are enough.
    constexpr std::size_t neighbours = 16;
    std::vector<std::tuple<double, std::size_t, std::size_t>> candidates;
    for (std::size_t d = 0; d < depths.size(); ++d) {
        const auto after =
            std::lower_bound(colours.begin(), colours.end(), depths[d].stamp_s,
                             [](const ListedImage& image, double stamp) { return image.stamp_s < stamp; });
        const auto middle = static_cast<std::size_t>(after - colours.begin());
        for (std::size_t c = middle - std::min(middle, neighbours); c < std::min(middle + neighbours, colours.size());
             ++c)
            if (const double apart = std::abs(colours[c].stamp_s - depths[d].stamp_s); apart <= limit_s)
                candidates.emplace_back(apart, d, c);
    }
    std::sort(candidates.begin(), candidates.end());
    std::vector<std::optional<std::size_t>> colour_of(depths.size());
    std::vector<bool> used(colours.size());
    for (const auto& [apart, d, c] : candidates) {
        if (colour_of[d] || used[c])
            continue;
        colour_of[d] = c;
        used[c] = true;
    }
    return colour_of;
}

auto first_after(const std::vector<StampedPose>& poses, double stamp_s) {
    return std::lower_bound(poses.begin(), poses.end(), stamp_s,
                            [](const StampedPose& pose, double stamp) { return pose.stamp_s < stamp; });
}

/// From the poses at least 10 ms away on either side; zero where the trajectory has gaps.
Motion motion_at(const std::vector<StampedPose>& poses, double stamp_s, const Eigen::Isometry3d& at) {
    constexpr double least_s = 0.01, most_s = 0.1;
    const auto after = first_after(poses, stamp_s + least_s), next = first_after(poses, stamp_s - least_s);
    if (after == poses.end() || next == poses.begin())
        return {};
    const StampedPose& before = *std::prev(next);
    if (after->stamp_s - stamp_s > most_s || stamp_s - before.stamp_s > most_s)
        return {};
    return motion_between(before.world_from_camera, after->world_from_camera, after->stamp_s - before.stamp_s, at);
}

// --- frames ---

CaptureEntry entry_of(const fs::path& folder, const ListedImage& depth) {
    CaptureEntry entry;
    entry.name = depth.stamp;
    entry.stamp_s = depth.stamp_s;
    entry.depth = folder / depth.name;
    if (const auto trouble = trouble_with(folder, depth.name); !trouble.empty())
        entry.problem = fmt::format("{}: {}", at_line(folder / "depth.txt", depth.line), trouble);
    return entry;
}

void add_colour(const fs::path& folder, const ListedImage& colour, CaptureEntry& entry) {
    entry.colour_stamp_s = colour.stamp_s;
    const auto trouble = trouble_with(folder, colour.name);
    if (trouble.empty())
        entry.colour = folder / colour.name;
    else
        entry.warnings.push_back(
            fmt::format("{}: {}; processed without colour.", at_line(folder / "rgb.txt", colour.line), trouble));
}

void add_colours(const fs::path& folder, const std::vector<ListedImage>& depths, double limit_s, Capture& capture) {
    const fs::path list = folder / "rgb.txt";
    if (!is_file(list)) {
        capture.warnings.emplace_back("no rgb.txt; depth alone is processed.");
        return;
    }
    const auto colours = read_list(list, capture.warnings);
    if (colours.empty()) {
        capture.warnings.push_back(list.string() + ": no entries; depth alone is processed.");
        return;
    }
    const auto colour_of = pair_by_time(depths, colours, limit_s);
    const auto pairs = static_cast<std::size_t>(
        std::count_if(colour_of.begin(), colour_of.end(), [](const auto& c) { return c.has_value(); }));
    if (pairs == 0)
        throw Error(fmt::format(
            "{}: no depth and colour image are within {} s of each other: depth.txt starts {:.3f} s {} rgb.txt "
            "({} against {}). --association-limit sets how far apart they may be",
            folder.string(), limit_s, std::abs(depths[0].stamp_s - colours[0].stamp_s),
            depths[0].stamp_s < colours[0].stamp_s ? "before" : "after", depths[0].stamp, colours[0].stamp));
    for (std::size_t i = 0; i < depths.size(); ++i) {
        if (colour_of[i])
            add_colour(folder, colours[*colour_of[i]], capture.entries[i]);
        else
            capture.entries[i].warnings.push_back(
                fmt::format("no colour image within {} s; depth alone is processed.", limit_s));
    }
    if (pairs < colours.size())
        capture.warnings.push_back(fmt::format("{}: {} without a depth image within {} s; not used.", list.string(),
                                               counted(colours.size() - pairs, "colour image"), limit_s));
}

void add_poses(const fs::path& folder, double limit_s, double offset_s, Capture& capture) {
    const fs::path list = folder / "groundtruth.txt";
    if (!is_file(list))
        return;
    const auto poses = read_tum_trajectory(list, capture.warnings);
    if (poses.empty()) {
        capture.warnings.push_back(list.string() + ": no usable pose.");
        return;
    }
    std::size_t without = 0;
    for (CaptureEntry& entry : capture.entries) {
        const double stamp_s = *entry.stamp_s + offset_s;
        entry.world_from_camera = pose_at(poses, stamp_s, limit_s);
        if (entry.world_from_camera)
            entry.motion = motion_at(poses, stamp_s, *entry.world_from_camera);
        without += !entry.world_from_camera;
        if (!entry.world_from_camera)
            entry.warnings.push_back(fmt::format("no pose within {} s in groundtruth.txt.", limit_s));
    }
    if (without == capture.entries.size())
        capture.warnings.push_back(
            fmt::format("{}: no pose within {} s of any depth image; the first pose is {:.3f} s from the first image.",
                        list.string(), limit_s, std::abs(poses.front().stamp_s - *capture.entries.front().stamp_s)));
}

// --- camera ---

/// The number in a word "freiburg1" or "fr1" of the text, underscores and slashes being between words.
std::optional<int> freiburg_in(std::string_view text) {
    const auto in_word = [&](std::size_t at) {
        return at < text.size() && std::isalnum(static_cast<unsigned char>(text[at]));
    };
    for (const std::string_view name : {"freiburg", "fr"})
        for (auto at = text.find(name); at != std::string_view::npos; at = text.find(name, at + 1)) {
            const std::size_t digit = at + name.size();
            const bool alone = (at == 0 || !in_word(at - 1)) && digit < text.size() && !in_word(digit + 1);
            if (alone && text[digit] >= '1' && text[digit] <= '3')
                return text[digit] - '0';
        }
    return std::nullopt;
}

/// The benchmark names its recordings after the room they were made in: in the lists' comments, or in the folder's
/// name.
std::optional<int> freiburg_number(const fs::path& folder) {
    for (const char* list : {"rgb.txt", "depth.txt", "groundtruth.txt"}) {
        std::error_code ignored;
        if (!is_file(folder / list))
            continue;
        const std::string start = read_bytes(folder / list, 4096);
        for (const TextLine& line : text_lines(start))
            if (const auto found = freiburg_in(line.text); found && line.text.starts_with('#'))
                return found;
    }
    std::error_code ignored; // without a working directory the name as given must do
    const fs::path whole = fs::absolute(folder, ignored);
    return freiburg_in((ignored ? folder : whole).string());
}

CameraFile published_camera(int freiburg, std::vector<std::string>& warnings) {
    static constexpr double numbers[3][4] = {
        {517.3, 516.5, 318.6, 255.3}, {520.9, 521.0, 325.1, 249.7}, {535.4, 539.2, 320.1, 247.6}};
    const auto& [fx, fy, cx, cy] = numbers[freiburg - 1];
    CameraFile result;
    result.camera = {{fx, fy, cx, cy, {640, 480}}, {}, fmt::format("TUM's published numbers for freiburg{}", freiburg)};
    result.registration = Registration::yes; // the benchmark's own depth images are registered to colour
    if (freiburg != 3)
        warnings.push_back(fmt::format(
            "freiburg{}'s published lens distortion belongs to the colour camera and is not applied to depth.",
            freiburg));
    return result;
}

std::optional<CameraFile> tum_camera(const fs::path& folder, cv::Size size, std::vector<std::string>& warnings) {
    if (auto camera = camera_in(folder, warnings))
        return camera;
    if (size != cv::Size(640, 480)) {
        if (!size.empty())
            warnings.push_back(
                fmt::format("{}: no camera.json, and TUM's published cameras are for 640x480, not {}x{}.",
                            folder.string(), size.width, size.height));
        return std::nullopt;
    }
    if (const auto freiburg = freiburg_number(folder))
        return published_camera(*freiburg, warnings);
    CameraFile fallback;
    fallback.camera = {
        {525, 525, 319.5, 239.5, size}, {}, "assumed: TUM's default, no camera.json and no freiburg1-3 in the names"};
    warnings.push_back(
        fmt::format("{}: no camera.json; TUM's default fx 525 fy 525 cx 319.5 cy 239.5 is assumed.", folder.string()));
    return fallback;
}

/// The other lists tell a TUM recording. Read as a plain folder of images, its depth would be taken for millimetres.
void refuse_without_depth_list(const fs::path& folder) {
    const bool colours = is_file(folder / "rgb.txt");
    const bool poses = is_file(folder / "groundtruth.txt");
    if (colours && (poses || is_folder(folder / "depth")))
        throw Error(fmt::format("{}: missing, though {} a TUM recording: expected a list of \"time depth/FILE\" lines",
                                (folder / "depth.txt").string(),
                                poses ? "rgb.txt and groundtruth.txt say that this is"
                                      : "rgb.txt and the folder depth/ say that this is"));
}

} // namespace

std::optional<Listing> list_tum(const fs::path& folder, const CaptureOptions& options) {
    if (!is_file(folder / "depth.txt")) {
        refuse_without_depth_list(folder);
        return std::nullopt;
    }
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = usual_encoding("tum", "TUM layout");
    capture.registration_reason =
        "TUM's own recordings are registered, but nothing in this folder says that it is one of them";
    const auto depths = read_list(folder / "depth.txt", capture.warnings);
    if (depths.empty())
        throw Error((folder / "depth.txt").string() + ": no entries");
    for (const ListedImage& depth : depths)
        capture.entries.push_back(entry_of(folder, depth));
    add_colours(folder, depths, options.association_limit_s, capture);
    const bool none_there = std::all_of(capture.entries.begin(), capture.entries.end(),
                                        [](const CaptureEntry& entry) { return !entry.problem.empty(); });
    if (none_there)
        capture.warnings.push_back(fmt::format("{}: none of its {} is there.", (folder / "depth.txt").string(),
                                               counted(depths.size(), "image")));
    listing.find_camera = [folder](cv::Size size, std::vector<std::string>& warnings) {
        return tum_camera(folder, size, warnings);
    };
    listing.find_poses = [folder, limit_s = options.association_limit_s](Capture& found, double offset_s) {
        add_poses(folder, limit_s, offset_s, found);
    };
    return listing;
}

} // namespace scanshade
