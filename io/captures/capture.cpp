// open_capture: which layout, camera and depth encoding; load: one frame's files decoded and checked against each
// other.
#include "io/captures/capture.h"

#include "io/captures/formats.h"
#include "io/captures/listing/layouts.h"
#include "io/captures/listing/trajectory.h"
#include "io/captures/plausibility.h"
#include "io/captures/recording_formats.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/format.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/imgproc.hpp>
#include <set>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

// --- opening ---

constexpr std::size_t enough_for_signatures = 1 << 12;

/// Of a file that begins so; null where it holds no recording.
const RecordingFormat* recording_format(std::string_view start) {
    const auto rows = recording_formats();
    const auto found = std::ranges::find_if(rows, [&](const auto& row) { return row.begins && row.begins(start); });
    return found == rows.end() ? nullptr : &*found;
}

Listing named(Listing listing, const RecordingFormat& format) {
    listing.generic = format.generic;
    if (listing.capture.kind.empty())
        listing.capture.kind = format.name;
    return listing;
}

/// A folder's only file that holds a recording; several are listed in an Error.
std::optional<fs::path> recording_in(const fs::path& folder) {
    std::vector<fs::path> recordings;
    for (const fs::path& file : files_in(folder))
        if (recording_format(read_bytes(file, enough_for_signatures)))
            recordings.push_back(file);
    if (recordings.size() > 1)
        throw Error(fmt::format("{}: {} recordings, expected one: open {} or another by its name", folder.string(),
                                recordings.size(), recordings.front().filename().string()));
    return recordings.empty() ? std::nullopt : std::optional(recordings.front());
}

/// The names of recordings that are files.
std::string recording_files() {
    std::vector<std::string_view> names;
    for (const RecordingFormat& format : recording_formats())
        if (*format.extensions)
            names.emplace_back(format.name);
    return listed(names, "or");
}

/// "`camera_matrix.csv` with `depth/`" -> "camera_matrix.csv": what a row is told by first.
std::string first_sign(const RecordingFormat& format) {
    std::string sign = format.recognised;
    for (const std::string_view end : {";", ":", ",", " with", " beside"})
        sign = sign.substr(0, sign.find(end));
    std::erase(sign, '`');
    return sign;
}

[[noreturn]] void refuse_folder(const fs::path& folder) {
    std::vector<std::string> signs;
    for (const RecordingFormat& format : recording_formats())
        if (format.folder && !format.begins && std::ranges::count(signs, first_sign(format)) == 0)
            signs.push_back(first_sign(format));
    throw NoFrames(fmt::format("no frames found in {}: looked for {}, and for one file that is a recording ({}); "
                               "`scanshade help formats` tells more of each",
                               folder.string(), fmt::join(signs, ", "), recording_files()));
}

Listing list_folder(const fs::path& folder, const CaptureOptions& options) {
    for (const RecordingFormat& format : recording_formats())
        if (auto listing = format.folder ? format.folder(folder, options) : std::nullopt)
            return named(*std::move(listing), format);
    const auto file = recording_in(folder);
    if (!file)
        refuse_folder(folder);
    const RecordingFormat& format = *recording_format(read_bytes(*file, enough_for_signatures));
    return named(format.file(*file, options), format);
}

[[noreturn]] void refuse_file(const fs::path& file) {
    throw Error(fmt::format("{}: neither a folder, a recording ({}), a depth image ({}) nor a cloud ({})",
                            file.string(), recording_files(), listed(depth_format_names(), "or"),
                            listed(cloud_format_names(), "or")));
}

/// As a shell takes it.
std::string quoted(const std::string& word) {
    const auto plain = [](unsigned char c) {
        return std::isalnum(c) != 0 || std::string_view("/._-+:").find(static_cast<char>(c)) != std::string::npos;
    };
    if (std::ranges::all_of(word, plain))
        return word;
    std::string text = "'";
    for (const char c : word)
        text += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return text + "'";
}

/// Files that are packed as a whole are not read: no frame could be reached without unpacking all before it, and every
/// command and every process of a job would unpack them anew.
void refuse_packed(std::string_view start, const fs::path& file) {
    struct Packer {
        std::string_view magic;
        const char* program;
    };
    constexpr std::array packers = {Packer{"\x1f\x8b", "gzip"}, Packer{"BZh", "bzip2"},
                                    Packer{std::string_view("\xfd"
                                                            "7zXZ\0",
                                                            6),
                                           "xz"},
                                    Packer{"\x28\xb5\x2f\xfd", "zstd"}, Packer{"\x04\x22\x4d\x18", "lz4"}};
    for (const Packer& packer : packers) {
        if (!start.starts_with(packer.magic))
            continue;
        const std::string extension = lower_extension(file);
        const bool tar = extension.starts_with(".t"); // .tgz, .tbz2, .txz, .tzst
        const fs::path stem = file.has_extension() ? file.parent_path() / file.stem() : file;
        const std::string whole = tar || !file.has_extension() ? stem.string() + ".tar" : stem.string();
        throw Error(
            fmt::format("{}: packed as a whole by {}, so that no frame can be reached by itself; unpack it once: "
                        "`{} -dc {} > {}`",
                        file.string(), packer.program, packer.program, quoted(file.string()), quoted(whole)));
    }
}

Listing list_file(const fs::path& file, const CaptureOptions& options) {
    const std::string start = read_bytes(file, enough_for_signatures);
    if (const RecordingFormat* format = recording_format(start))
        return named(format->file(file, options), *format);
    CaptureEntry entry;
    entry.name = file.stem().string();
    Listing listing;
    listing.find_camera = [](cv::Size, std::vector<std::string>&) { return std::nullopt; };
    if (is_cloud(start, file)) {
        entry.cloud = file;
        listing.capture.kind = name_of(FormatKind::cloud);
        listing.capture.depth = depth_encoding("m", "of clouds: metres by custom, or the unit that the file names");
        listing.capture.registration_reason = "colours belong to the points";
    } else {
        if (!image_format(start))
            refuse_packed(start, file);
        if (!image_format(start) && !has_depth_extension(file))
            refuse_file(file);
        entry.depth = file;
        listing.capture.kind = name_of(FormatKind::depth_image);
        listing.capture.depth = assumed_encoding(file);
        listing.capture.registration_reason = "there is no colour";
        listing.find_camera = [file](cv::Size, std::vector<std::string>&) { return camera_beside_pclzf(file); };
    }
    listing.capture.entries.push_back(std::move(entry));
    return listing;
}

/// The size of the first depth image that has a readable header; 0x0 where none of the first few has.
cv::Size depth_size(const std::vector<CaptureEntry>& entries) {
    int tries = 8;
    for (const CaptureEntry& entry : entries) {
        if (!entry.problem.empty() || entry.depth.empty())
            continue;
        if (tries-- == 0)
            break;
        try {
            return depth_size_of(entry);
        } catch (const Outage&) {
            throw;
        } catch (const Error&) {
            continue; // loading this frame will say why
        }
    }
    return {};
}

/// Gives a single depth image its colour, which the user says belongs to it.
void take_colour(Capture& capture, const fs::path& colour) {
    if (capture.kind != name_of(FormatKind::depth_image))
        throw Misuse(fmt::format("colour: {} is for a single depth image, and {} is a capture of the kind '{}', which "
                                 "has its own colour images",
                                 colour.string(), capture.path.string(), capture.kind));
    if (!is_file(colour))
        throw Error(
            fmt::format("{}: no such file, expected the colour image of {}", colour.string(), capture.path.string()));
    capture.entries.front().colour = colour;
    if (capture.registration != Registration::unknown)
        return;
    capture.registration = Registration::yes;
    capture.registration_reason = "--colour names the image of these pixels";
}

/// The same poses for cameras with y downwards, in a world whose y is turned as well: mirrored twice, they stay
/// rotations.
void turn_poses_y_down(Capture& capture) {
    const Eigen::DiagonalMatrix<double, 3> mirror(1, -1, 1);
    for (CaptureEntry& entry : capture.entries) {
        if (!entry.world_from_camera)
            continue;
        Eigen::Isometry3d& pose = *entry.world_from_camera;
        pose.linear() = (mirror * pose.linear() * mirror).eval();
        pose.translation() = (mirror * pose.translation()).eval();
        if (!entry.motion)
            continue;
        entry.motion->rotation_per_s = -(mirror * entry.motion->rotation_per_s).eval();
        entry.motion->translation_per_s = (mirror * entry.motion->translation_per_s).eval();
    }
}

/// Whether the camera's y axis was upwards, so that the capture's own poses are those of such cameras.
bool settle_camera(Listing& listing, const CaptureOptions& options) {
    Capture& capture = listing.capture;
    const bool depth_images = std::any_of(capture.entries.begin(), capture.entries.end(),
                                          [](const CaptureEntry& entry) { return !entry.depth.empty(); });
    const cv::Size size = depth_images ? depth_size(capture.entries) : cv::Size();
    const auto found = options.camera.empty() ? listing.find_camera(size, capture.warnings)
                                              : std::optional(camera_from_argument(options.camera));
    if (!found) {
        if (depth_images)
            capture.warnings.push_back("no camera: the capture has none; give --camera FILE or --camera fx,fy,cx,cy.");
        return false;
    }
    capture.warnings.insert(capture.warnings.end(), found->warnings.begin(), found->warnings.end());
    capture.camera = found->camera;
    if (capture.camera->pinhole.size.empty())
        capture.camera->pinhole.size = size;
    if (!capture.camera->pinhole.size.empty())
        check(*capture.camera);
    if (found->depth_units_per_metre)
        capture.depth = depth_encoding(fmt::format("{}", *found->depth_units_per_metre), found->camera.origin);
    capture.depth_correction = found->depth_correction;
    capture.pose_time_offset_s = found->pose_time_offset_s;
    capture.colour_camera = found->colour;
    if (found->colour && found->registration == Registration::unknown) {
        capture.registration = Registration::no;
        capture.registration_reason = "a camera of its own took the colour, according to " + found->camera.origin;
    }
    if (found->registration == Registration::unknown)
        return found->y_was_up;
    capture.registration = found->registration;
    capture.registration_reason =
        (found->registration == Registration::yes ? "registered, according to " : "unregistered, according to ") +
        found->camera.origin;
    return found->y_was_up;
}

/// Names of what looks like poses or cameras in a folder that was read as a generic one.
std::vector<std::string> unused_in(const fs::path& folder, const Listing& listing) {
    static const std::set<std::string> folders{"pose",   "poses",       "intrinsic", "intrinsics",
                                               "calib",  "calibration", "camera",    "cameras",
                                               "sparse", "colmap",      "extrinsics"};
    constexpr std::array words{"pose",      "traj",  "odom",   "transform",  "intrinsic",
                               "extrinsic", "calib", "camera", "groundtruth"};
    constexpr std::array endings{".pincam", ".traj", ".log", ".npz"};
    const auto speaks = [&](std::string name) {
        std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
        return std::ranges::any_of(words, [&](const char* word) { return name.find(word) != std::string::npos; }) ||
               std::ranges::any_of(endings, [&](const char* ending) { return name.ends_with(ending); });
    };
    std::set<std::string> used(listing.used.begin(), listing.used.end());
    if (listing.capture.camera)
        used.insert(fs::path(listing.capture.camera->origin).filename().string());
    for (const CaptureEntry& entry : listing.capture.entries) // images may be called so
        used.insert(entry.depth.path().filename().string());
    std::vector<std::string> unused;
    std::error_code ignored;
    for (const auto& [name, kind] : items_in(folder, ignored))
        if (!used.contains(name) && (kind == FolderItem::Kind::folder ? folders.contains(name) : speaks(name)))
            unused.push_back(name);
    std::ranges::sort(unused);
    return unused;
}

// --- loading ---

std::string text(cv::Size size) { return fmt::format("{}x{}", size.width, size.height); }

/// Camera, depth and colour must have the same size: nothing is scaled unasked.
void check_depth_size(const Frame& frame, cv::Size found, const fs::path& depth) {
    const cv::Size expected = frame.camera.pinhole.size;
    if (!expected.empty() && found != expected)
        throw Error(fmt::format("{}: depth is {}, but its camera is for {} ({})", depth.string(), text(found),
                                text(expected), frame.camera.origin));
}

/// A network share that disappears while frames are read is not their fault.
void check_still_there(const Capture& capture) {
    if (!is_there(capture.path))
        throw Outage(capture.path.string() + ": not there any more");
}

void load_colour(const Capture& capture, const CaptureEntry& entry, cv::Size depth_size, Frame& frame) {
    try {
        StoredColour stored = stored_colour_of(entry);
        frame.colour = stored.colour;
        frame.deep_colour = stored.deep;
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        check_still_there(capture);
        frame.warnings.push_back(fmt::format("{}; processed without colour.", failure.what()));
        return;
    }
    const cv::Size colour = frame.colour.size(),
                   expected = frame.colour_camera ? frame.colour_camera->camera.pinhole.size : depth_size;
    if (colour == expected)
        return;
    const auto shape = [](cv::Size size) { return static_cast<double>(size.width) / size.height; };
    if (capture.colour_in_more_pixels && !frame.colour_camera && colour.width > expected.width &&
        std::abs(shape(colour) / shape(expected) - 1) < 0.02) {
        cv::resize(frame.colour, frame.colour, expected, 0, 0, cv::INTER_AREA);
        if (!frame.deep_colour.empty())
            cv::resize(frame.deep_colour, frame.deep_colour, expected, 0, 0, cv::INTER_AREA);
        return;
    }
    frame.warnings.push_back(fmt::format("{}: colour is {}, {} is {}; processed without colour.", entry.colour,
                                         text(colour), frame.colour_camera ? "its camera" : "depth", text(expected)));
    frame.colour = cv::Mat3b();
    frame.deep_colour = cv::Mat3w();
}

void correct(cv::Mat1f& depth_m, const DepthCorrection& correction) {
    if (!correction.any())
        return;
    std::transform(depth_m.begin(), depth_m.end(), depth_m.begin(), [&](float z) {
        return z > 0 ? std::max(0.0F, static_cast<float>(correction(z))) : z; // depth corrected below zero is a hole
    });
}

void take_camera(const Capture& capture, const CaptureEntry& entry, cv::Size depth_size, Frame& frame) {
    frame.colour_camera = capture.colour_camera;
    if (entry.camera) {
        frame.camera = *entry.camera;
        check_depth_size(frame, depth_size, entry.depth);
        return;
    }
    if (!capture.camera) { // anything that needs the camera refuses this one, and says its origin
        frame.camera.origin = "none is known; give --camera FILE or --camera fx,fy,cx,cy";
        return;
    }
    frame.camera = *capture.camera;
    if (frame.camera.pinhole.size.empty())
        frame.camera.pinhole.size = depth_size;
    check_depth_size(frame, depth_size, entry.depth);
}

DepthEncoding encoding_of(const Capture& capture, const CaptureEntry& entry) {
    if (!(entry.depth_units_per_metre > 0))
        return capture.depth;
    return depth_encoding(fmt::format("{}", entry.depth_units_per_metre), capture.depth.origin);
}

/// A share of guesses that is worth a word.
void tell_guesses(const Capture& capture, double beyond, double all, Frame& frame) {
    constexpr double many = 0.05;
    if (beyond > many * all)
        frame.warnings.push_back(fmt::format("{:.0f} % of the depths lie beyond {:g} m, where they are the recorder's "
                                             "guesses.",
                                             100 * beyond / all, capture.guessed_beyond_m));
}

/// Apple's 0 low, 1 medium, 2 high; also of what is spread over a byte: 0, 127 (or 54), 255.
int confidence_level(uchar value) {
    if (value <= 2)
        return value;
    return value == 255 ? 2 : 1;
}

/// Depth of too low a confidence becomes holes.
void leave_out_unsure(const CaptureEntry& entry, int lowest, Frame& frame) {
    cv::Mat1b levels;
    try {
        levels = confidence_of(entry);
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        frame.warnings.push_back(fmt::format("{}; all depth is believed.", failure.what()));
        return;
    }
    if (levels.size() != frame.depth_m.size()) {
        frame.warnings.push_back(fmt::format("{}: confidence is {}, depth is {}; all depth is believed.",
                                             entry.confidence, text(levels.size()), text(frame.depth_m.size())));
        return;
    }
    std::transform(frame.depth_m.begin(), frame.depth_m.end(), levels.begin(), frame.depth_m.begin(),
                   [&](float z, uchar value) { return confidence_level(value) >= lowest ? z : 0.0F; });
}

void load_depth(const Capture& capture, const CaptureEntry& entry, const cv::Mat& stored, Frame& frame,
                bool with_colour) {
    require_memory(stored.total() * sizeof(float),
                   fmt::format("{}: a depth image of {} pixels", entry.depth, text(stored.size())));
    const DepthEncoding encoding = encoding_of(capture, entry);
    frame.depth_m = during(entry.depth, [&] { return depth_in_metres(stored, encoding); });
    take_camera(capture, entry, stored.size(), frame);
    frame.doubts = doubts_about(frame.depth_m, stored, encoding);
    if (!entry.confidence.empty())
        leave_out_unsure(entry, capture.confidence_min, frame);
    if (capture.guessed_beyond_m > 0)
        tell_guesses(capture, cv::countNonZero(frame.depth_m > capture.guessed_beyond_m),
                     cv::countNonZero(frame.depth_m), frame);
    correct(frame.depth_m, capture.depth_correction);
    if (with_colour && !entry.colour.empty())
        load_colour(capture, entry, stored.size(), frame);
}

/// How many pixels have each value. In four tables, by turns: equal neighbours would wait for each other's sums.
std::vector<std::uint32_t> counts_of(const cv::Mat1w& stored) {
    constexpr std::size_t values = 1 << 16;
    std::vector<std::uint32_t> counts(4 * values);
    std::uint32_t *a = counts.data(), *b = a + values, *c = b + values, *d = c + values;
    for (int y = 0; y < stored.rows; ++y) {
        const ushort* row = stored[y];
        int x = 0;
        for (; x + 4 <= stored.cols; x += 4) {
            ++a[row[x]];
            ++b[row[x + 1]];
            ++c[row[x + 2]];
            ++d[row[x + 3]];
        }
        for (; x < stored.cols; ++x)
            ++a[row[x]];
    }
    for (std::size_t value = 0; value < values; ++value)
        a[value] += b[value] + c[value] + d[value];
    counts.resize(values);
    return counts;
}

void examine_depth(const Capture& capture, const CaptureEntry& entry, ExaminedFrame& examined) {
    const cv::Mat stored = stored_depth_of(entry);
    examined.depth_size = stored.size();
    if (stored.type() != CV_16UC1 || !entry.confidence.empty()) {
        load_depth(capture, entry, stored, examined.frame, true);
        return;
    }
    take_camera(capture, entry, stored.size(), examined.frame);
    const DepthEncoding encoding = encoding_of(capture, entry);
    DepthTable metres = during(entry.depth, [&] { return depth_table(encoding); });
    const std::vector<std::uint32_t> counts = counts_of(stored);
    float largest_m = 0;
    for (int value = 0; value < metres.cols; ++value)
        if (counts[static_cast<std::size_t>(value)] > 0)
            largest_m = std::max(largest_m, metres(value));
    examined.frame.doubts = doubts_about(stored, metres, largest_m, encoding);
    correct(metres, capture.depth_correction);
    for (int value = 0; value < metres.cols; ++value)
        if (const std::uint32_t count = counts[static_cast<std::size_t>(value)]; count > 0 && metres(value) != 0)
            examined.levels.push_back({metres(value), count});
    std::ranges::sort(examined.levels, {}, &DepthLevel::z_m);
    if (capture.guessed_beyond_m > 0) {
        double beyond = 0, all = 0;
        for (const DepthLevel& level : examined.levels) {
            all += level.count;
            beyond += level.z_m > capture.guessed_beyond_m ? level.count : 0;
        }
        tell_guesses(capture, beyond, all, examined.frame);
    }
    if (!entry.colour.empty())
        load_colour(capture, entry, stored.size(), examined.frame);
}

void load_cloud(const Capture& capture, const CaptureEntry& entry, Frame& frame) {
    frame.cloud = read_cloud(entry.cloud, frame.warnings);
    if (frame.cloud->records->viewpoint)
        frame.world_from_camera = frame.cloud->records->viewpoint;
    if (!capture.camera)
        return;
    frame.camera = *capture.camera;
    Pinhole& pinhole = frame.camera.pinhole;
    const cv::Size grid = frame.cloud->grid;
    if (frame.cloud->organised()) {
        if (pinhole.size.empty())
            pinhole.size = grid;
        if (pinhole.size != grid)
            throw Error(fmt::format("{}: the cloud's grid is {}, but its camera is for {} ({})", entry.cloud,
                                    text(grid), text(pinhole.size), frame.camera.origin));
    } else if (pinhole.size.empty()) {
        // Four numbers do not include the image size; a principal point is usually in the middle.
        constexpr double widest = 1 << 14;
        if (!(pinhole.cx >= 0 && pinhole.cy >= 0 && pinhole.cx < widest / 2 && pinhole.cy < widest / 2))
            throw Error(fmt::format("{}: an image size is needed with this camera ({}); give a camera file",
                                    entry.cloud, frame.camera.origin));
        pinhole.size = {static_cast<int>(std::lround(2 * pinhole.cx + 1)),
                        static_cast<int>(std::lround(2 * pinhole.cy + 1))};
        frame.warnings.push_back(
            fmt::format("the camera names no image size; {} is taken from its principal point.", text(pinhole.size)));
    }
    check(frame.camera);
}

} // namespace

namespace {

/// Replaces the recording's poses by those of a file. Throws Error if no frame has one.
void take_poses(Capture& capture, const CaptureOptions& options) {
    const std::vector<StampedPose> poses = read_tum_trajectory(options.poses, capture.warnings);
    std::size_t found = 0;
    for (std::size_t i = 0; i < capture.entries.size(); ++i) {
        CaptureEntry& entry = capture.entries[i];
        entry.world_from_camera = entry.stamp_s ? pose_at(poses, *entry.stamp_s, options.association_limit_s)
                                                : pose_at(poses, static_cast<double>(i), 0.01);
        found += entry.world_from_camera.has_value();
    }
    if (found == 0)
        throw Error(fmt::format("{}: none of its {} poses belongs to a frame of {} (by {})", options.poses.string(),
                                poses.size(), capture.path.string(),
                                capture.entries.front().stamp_s ? "time" : "index"));
    capture.warnings.push_back(
        fmt::format("{} of {} frames have a pose in {}.", found, capture.entries.size(), options.poses.string()));
}

/// In stored units, of up to 15 frames spread over the whole capture: the middle of their median depths, so that it
/// does not depend on which frames a run takes. 0 where none of them can be read.
double median_depth_of(const Capture& capture) {
    constexpr std::size_t most_frames = 15, most_pixels_looked_at = 20000;
    std::vector<const CaptureEntry*> usable;
    for (const CaptureEntry& entry : capture.entries)
        if (entry.problem.empty() && !entry.depth.empty())
            usable.push_back(&entry);
    const std::size_t frames = std::min(most_frames, usable.size());
    std::vector<double> medians;
    for (std::size_t i = 0; i < frames; ++i) {
        try {
            const cv::Mat1f depth =
                depth_in_metres(stored_depth_of(*usable[i * usable.size() / frames]), arbitrary_encoding({}));
            const auto step =
                static_cast<int>(std::sqrt(static_cast<double>(depth.total()) / most_pixels_looked_at)) + 1;
            std::vector<float> known;
            for (int v = 0; v < depth.rows; v += step)
                for (int u = 0; u < depth.cols; u += step)
                    if (depth(v, u) > 0)
                        known.push_back(depth(v, u));
            if (!known.empty())
                medians.push_back(median(std::move(known)));
        } catch (const Outage&) {
            throw;
        } catch (const Error&) { // loading that frame reports the error
        }
    }
    return medians.empty() ? 0 : median(std::move(medians));
}

void divide_poses(Capture& capture, double by) {
    for (CaptureEntry& entry : capture.entries) {
        if (entry.world_from_camera)
            entry.world_from_camera->translation() /= by;
        if (entry.motion)
            entry.motion->translation_per_s /= by;
    }
}

/// In a capture whose unit is arbitrary, depth and poses share the unit. If it was told now, both become metres. If
/// not, both are measured by the scene: a workspace of twice the numbers is the same to the walk.
void settle_unit(Capture& capture, bool listed_in_arbitrary_unit, const CaptureOptions& options) {
    DepthEncoding& depth = capture.depth;
    if (!depth.arbitrary) {
        if (listed_in_arbitrary_unit && depth.kind == DepthEncoding::Kind::linear)
            divide_poses(capture, depth.units_per_metre);
        return;
    }
    if (capture.depth_correction.any())
        throw Error(fmt::format("{}: the depth correction of {} is in metres, and the unit of this capture is "
                                "arbitrary: give --depth-scale UNITS_PER_METRE",
                                capture.path.string(), capture.camera ? capture.camera->origin : "its camera"));
    const double median_units = median_depth_of(capture);
    if (median_units > 0)
        capture.median_depth = options.median_depth;
    capture.unit.units_per_length = median_units > 0 ? median_units / options.median_depth : 1;
    depth = arbitrary_encoding(depth.origin, capture.unit.units_per_length);
    for (CaptureEntry& entry : capture.entries)
        entry.depth_units_per_metre = 0;
    divide_poses(capture, capture.unit.units_per_length);
}

} // namespace

Capture open_capture(const fs::path& path, const CaptureOptions& options) {
    if (!is_there(path))
        throw Error(path.string() + ": no such file or folder");
    Listing listing = is_folder(path) ? list_folder(path, options) : list_file(path, options);
    Capture& capture = listing.capture;
    capture.path = path;
    capture.confidence_min = options.confidence_min;
    std::ranges::move(oddities_of_tar(path), std::back_inserter(capture.warnings));
    settle_names(capture.entries);
    const bool arbitrary = capture.depth.arbitrary;
    const bool y_was_up = settle_camera(listing, options);
    if (listing.find_poses)
        listing.find_poses(capture, capture.pose_time_offset_s);
    if (y_was_up)
        turn_poses_y_down(capture);
    if (!options.colour.empty())
        take_colour(capture, options.colour);
    if (!options.depth_scale.empty()) {
        capture.depth = depth_encoding(options.depth_scale, "--depth-scale");
        for (CaptureEntry& entry : capture.entries)
            entry.depth_units_per_metre = 0;
    }
    if (!options.camera.empty())
        for (CaptureEntry& entry : capture.entries)
            entry.camera = nullptr;
    if (!options.poses.empty())
        take_poses(capture, options);
    else if (const auto unused = listing.generic ? unused_in(path, listing) : std::vector<std::string>();
             !unused.empty())
        capture.warnings.push_back(fmt::format("{}: not used, though their names speak of poses or cameras: {}.",
                                               path.string(), fmt::join(unused, ", ")));
    settle_unit(capture, arbitrary, options);
    return std::move(capture);
}

void require_metres(const Capture& capture, const std::string& what) {
    if (capture.unit.arbitrary())
        throw Error(
            fmt::format("{}: {} needs lengths in metres, and the unit of this capture is arbitrary ({}): give it "
                        "as --depth-scale UNITS_PER_METRE",
                        capture.path.string(), what, capture.depth.origin));
}

namespace {

/// The captures in the folder's own folders and tars, and the last one opened: opening may read a whole recording.
std::vector<fs::path> captures_below(const fs::path& path, const CaptureOptions& options,
                                     std::optional<Capture>& last) {
    std::vector<fs::path> captures;
    std::error_code ignored;
    for (const auto& [name, kind] : items_in(path, ignored)) {
        const bool tar = kind != FolderItem::Kind::folder && lower_extension(name) == ".tar" && is_tar(path / name);
        if (name.starts_with('.') || (kind != FolderItem::Kind::folder && !tar))
            continue;
        try {
            last = open_capture(path / name, options);
            captures.push_back(path / name);
        } catch (const NoFrames&) {
            continue;
        }
    }
    std::ranges::sort(captures);
    return captures;
}

} // namespace

std::vector<fs::path> captures_below(const fs::path& path, const CaptureOptions& options) {
    std::optional<Capture> last;
    return captures_below(path, options, last);
}

Capture open_capture_at_or_below(const fs::path& path, const CaptureOptions& options) {
    try {
        return open_capture(path, options);
    } catch (const NoFrames&) {
        std::optional<Capture> last;
        const std::vector<fs::path> captures = captures_below(path, options, last);
        if (captures.empty())
            throw;
        if (captures.size() > 1)
            throw Error(fmt::format(
                "{}: {} captures lie in it, among them {} and {}; name one, or let `plan` list them", path.string(),
                captures.size(), captures[0].filename().string(), captures[1].filename().string()));
        last->warnings.insert(last->warnings.begin(), fmt::format("{}: no frames of its own; its folder {} is opened.",
                                                                  path.string(), captures[0].filename().string()));
        return *std::move(last);
    }
}

namespace {

/// The frame with the listing's facts, to which `read` adds the files' content.
template <class Read>
void read_frame(const Capture& capture, std::size_t index, Frame& frame, const Read& read) {
    if (index >= capture.entries.size())
        throw Error(fmt::format("{}: frame {} of {}", capture.path.string(), index, capture.entries.size()));
    const CaptureEntry& entry = capture.entries[index];
    if (!entry.problem.empty())
        throw Error(entry.problem);
    frame.name = entry.name;
    frame.warnings = entry.warnings;
    frame.world_from_camera = entry.world_from_camera;
    frame.registration = capture.registration;
    try {
        read(entry);
    } catch (const std::exception&) {
        check_still_there(capture);
        throw;
    }
}

} // namespace

Frame Capture::load(std::size_t index, bool with_colour) const {
    Frame frame;
    read_frame(*this, index, frame, [&](const CaptureEntry& entry) {
        entry.cloud.empty() ? load_depth(*this, entry, stored_depth_of(entry), frame, with_colour)
                            : load_cloud(*this, entry, frame);
    });
    return frame;
}

ExaminedFrame Capture::examine(std::size_t index) const {
    ExaminedFrame examined;
    read_frame(*this, index, examined.frame, [&](const CaptureEntry& entry) {
        entry.cloud.empty() ? examine_depth(*this, entry, examined) : load_cloud(*this, entry, examined.frame);
    });
    return examined;
}

} // namespace scanshade
