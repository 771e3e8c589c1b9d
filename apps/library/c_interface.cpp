// The C interface: handles and structs in, exceptions out as statuses.
#include "apps/library/include/scanshade/scanshade.h"

#include "apps/library/relief.h"
#include "apps/library/session.h"
#include "apps/refine/report.h"
#include "io/cameras/camera_formats.h"
#include "io/captures/formats.h"
#include "io/captures/plausibility.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/spread.h"
#include "projection/base/stopwatch.h"
#include "projection/project.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <mutex>
#include <new>
#include <numeric>

using namespace scanshade;
using library::Purpose;

struct scanshade_session {
    library::Session session;
};

struct scanshade_result {
    library::Result result;
    mutable std::once_flag described;
    mutable std::string info;
};

struct scanshade_capture {
    std::shared_ptr<const library::OpenedCapture> opened;
    std::string info;
};

struct scanshade_frame {
    std::shared_ptr<const library::OpenedCapture> opened;
    std::size_t index;
    Frame frame;
    std::optional<scanshade_camera> camera;
    std::array<double, 16> world_from_camera;
};

struct scanshade_refinement {
    scanshade_camera camera;
    std::string report, summary, trajectory;
};

struct scanshade_relief_maps {
    library::ReliefMaps result;
};

namespace {

using Matrix = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

thread_local std::string last_error;

scanshade_status failed(scanshade_status status, const char* why) noexcept {
    try {
        last_error = why;
    } catch (...) { // no memory for the text: an empty one needs none
        last_error.clear();
    }
    return status;
}

/// Runs the action; what it throws becomes a status and the thread's error text.
template <class Action>
scanshade_status guarded(Action&& action) noexcept {
    try {
        action();
        return SCANSHADE_OK;
    } catch (const Misuse& failure) {
        return failed(SCANSHADE_MISUSE, failure.what());
    } catch (const Outage& failure) {
        return failed(SCANSHADE_OUTAGE, failure.what());
    } catch (const Error& failure) {
        return failed(SCANSHADE_BAD_INPUT, failure.what());
    } catch (const std::bad_alloc&) {
        return failed(SCANSHADE_OUTAGE, "not enough memory");
    } catch (const std::exception& failure) {
        try {
            if (const auto no_memory = failed_allocation(failure))
                return failed(SCANSHADE_OUTAGE, no_memory->c_str());
        } catch (...) {
            return failed(SCANSHADE_OUTAGE, "not enough memory");
        }
        return failed(SCANSHADE_INTERNAL, failure.what());
    } catch (...) {
        return failed(SCANSHADE_INTERNAL, "unknown exception");
    }
}

/// Text that an action makes; null where it fails.
template <class Action>
const char* text_or_null(Action&& action) noexcept {
    const char* text = nullptr;
    (void)guarded([&] { text = action(); });
    return text;
}

void require(const void* pointer, const char* name) {
    if (!pointer)
        throw Misuse(fmt::format("{}: NULL given", name));
}

template <class Handle>
void start(Handle** out) {
    require(out, "output handle");
    *out = nullptr;
}

/// A caller's struct, with defaults for members that it does not have. `least` is the size of the first version.
template <class Struct>
Struct taken(const Struct* given, std::size_t least, const char* name) {
    require(given, name);
    if (given->size < least)
        throw Misuse(fmt::format("{}: size {} given, expected sizeof({}) = {}: use its INIT macro", name, given->size,
                                 name, sizeof(Struct)));
    Struct own{};
    std::memcpy(&own, given, std::min(given->size, sizeof(Struct)));
    return own;
}

/// Fills a caller's struct as far as it knows its members.
template <class Struct>
void give(Struct* out, Struct own, std::size_t least, const char* name) {
    (void)taken(out, least, name);
    own.size = out->size;
    std::memcpy(out, &own, std::min(out->size, sizeof(Struct)));
}

Settings settings_from(const scanshade_setting* settings, std::size_t count) {
    if (count > 0)
        require(settings, "settings");
    Settings given;
    for (std::size_t i = 0; i < count; ++i) {
        require(settings[i].name, "name of a setting");
        if (!settings[i].value)
            throw Misuse(fmt::format("{}: NULL given, expected its value as text", settings[i].name));
        given.emplace_back(settings[i].name, settings[i].value);
    }
    return given;
}

library::Wanted wanted_from(std::uint32_t outputs) {
    if (outputs & ~std::uint32_t{SCANSHADE_CONFIDENCE | SCANSHADE_NORMALS})
        throw Misuse(fmt::format("outputs: {} given, expected a sum of SCANSHADE_ flags", outputs));
    return {(outputs & SCANSHADE_CONFIDENCE) != 0, (outputs & SCANSHADE_NORMALS) != 0};
}

// ---------------------------------------------------------------------------------------------------- cameras

constexpr std::size_t first_camera = offsetof(scanshade_camera, denominator); ///< without a rational lens

Camera camera_from(const scanshade_camera* given, cv::Size size) {
    const scanshade_camera c = taken(given, first_camera, "camera");
    if (c.lens != SCANSHADE_BROWN && c.lens != SCANSHADE_FISHEYE && c.lens != SCANSHADE_RATIONAL)
        throw Misuse(
            fmt::format("lens: {} given, expected SCANSHADE_BROWN, SCANSHADE_FISHEYE or SCANSHADE_RATIONAL", c.lens));
    if (!(c.fx != 0))
        throw Error("the depth image has no camera: fx, fy, cx and cy are needed");
    Camera camera{{c.fx, c.fy, c.cx, c.cy, {c.width, c.height}}, {}, "given"};
    if (c.width == 0 && c.height == 0)
        camera.pinhole.size = size;
    std::vector<double> lens(c.distortion, c.distortion + std::size(c.distortion));
    if (c.lens == SCANSHADE_RATIONAL)
        lens.insert(lens.end(), c.denominator, c.denominator + std::size(c.denominator));
    for (const double number : lens)
        if (!std::isfinite(number))
            throw Error(fmt::format("distortion: {} given, expected finite numbers", number));
    camera.distortion = c.lens == SCANSHADE_FISHEYE ? kannala_brandt(lens) : brown_conrady(lens);
    return camera;
}

scanshade_camera to_c(const Camera& camera) {
    const auto& [fx, fy, cx, cy, size] = camera.pinhole;
    const Distortion& d = camera.distortion;
    if (d.model == LensModel::kannala_brandt)
        return {sizeof(scanshade_camera),    fx, fy, cx, cy, size.width, size.height, SCANSHADE_FISHEYE,
                {d.k1, d.k2, d.k3, d.k4, 0}, {}};
    return {sizeof(scanshade_camera),
            fx,
            fy,
            cx,
            cy,
            size.width,
            size.height,
            d.rational() ? SCANSHADE_RATIONAL : SCANSHADE_BROWN,
            {d.k1, d.k2, d.p1, d.p2, d.k3},
            {d.k4, d.k5, d.k6}};
}

// ---------------------------------------------------------------------------------------------------- arrays

std::size_t bytes_of(std::int32_t type, const char* name) {
    switch (type) {
    case SCANSHADE_UINT16:
        return 2;
    case SCANSHADE_FLOAT32:
        return 4;
    case SCANSHADE_FLOAT64:
        return 8;
    default:
        throw Misuse(fmt::format("{}: type {} given, expected one of scanshade_type", name, type));
    }
}

/// Rows of x, y, z as points of double precision.
std::vector<Eigen::Vector3d> vectors_from(const void* values, std::int32_t type, std::int64_t count, std::int64_t bytes,
                                          const char* name) {
    const std::size_t packed = 3 * bytes_of(type, name);
    if (type == SCANSHADE_UINT16)
        throw Misuse(fmt::format("{}: integers given, expected FLOAT32 or FLOAT64", name));
    const std::int64_t step = bytes == 0 ? static_cast<std::int64_t>(packed) : bytes;
    std::vector<Eigen::Vector3d> vectors(static_cast<std::size_t>(count));
    const auto* row = static_cast<const std::byte*>(values);
    for (Eigen::Vector3d& vector : vectors) {
        if (type == SCANSHADE_FLOAT32) {
            float xyz[3];
            std::memcpy(xyz, row, sizeof xyz);
            vector = {xyz[0], xyz[1], xyz[2]};
        } else {
            std::memcpy(vector.data(), row, 3 * sizeof(double));
        }
        row += step;
    }
    return vectors;
}

/// Depth images of the caller as frames of a listing.
class DepthFrames {
  public:
    explicit DepthFrames(const scanshade_depth* given) : depth_(taken(given, sizeof(scanshade_depth), "depth")) {
        require(depth_.values, "depth values");
        const std::size_t element = bytes_of(depth_.type, "depth");
        if (depth_.type == SCANSHADE_FLOAT64)
            throw Misuse("depth: FLOAT64 given, expected UINT16 or FLOAT32");
        if (depth_.width <= 0 || depth_.height <= 0 ||
            static_cast<std::uint64_t>(depth_.width) * static_cast<std::uint64_t>(depth_.height) > most_pixels)
            throw Misuse(fmt::format("depth: an image of {}x{} pixels given, expected 1 to {} pixels", depth_.width,
                                     depth_.height, most_pixels));
        if (depth_.count < 1)
            throw Misuse(fmt::format("depth: {} images given, expected at least one", depth_.count));
        row_bytes_ = depth_.row_bytes != 0 ? depth_.row_bytes : static_cast<std::int64_t>(element) * depth_.width;
        image_bytes_ = depth_.image_bytes != 0 ? depth_.image_bytes : row_bytes_ * depth_.height;
        if (row_bytes_ < static_cast<std::int64_t>(element) * depth_.width)
            throw Misuse(fmt::format("depth: rows of {} bytes given, expected at least {}", row_bytes_,
                                     static_cast<std::int64_t>(element) * depth_.width));
        const bool integers = depth_.type == SCANSHADE_UINT16;
        encoding_ = depth_encoding(depth_.depth_scale ? depth_.depth_scale
                                   : integers         ? "mm"
                                                      : "m",
                                   depth_.depth_scale ? "--depth-scale" : "assumed");
        encoding_.stated = encoding_.by_hand = depth_.depth_scale != nullptr;
        camera_ = camera_from(depth_.camera, size());
        listing_.kind = name_of(FormatKind::depth_image);
        listing_.camera = camera_;
        for (std::int64_t i = 0; i < depth_.count; ++i) {
            CaptureEntry& entry = listing_.entries.emplace_back();
            entry.name = fmt::format("{}", i);
            entry.world_from_camera = pose(i);
        }
    }

    [[nodiscard]] library::Source source() const {
        return {nullptr, listing_, [this](std::size_t index) { return frame(index); },
                [this](const RunSettings& asked, const std::string&) { return beforehand(asked); }};
    }

  private:
    [[nodiscard]] cv::Size size() const { return {depth_.width, depth_.height}; }

    [[nodiscard]] std::optional<Eigen::Isometry3d> pose(std::int64_t index) const {
        if (!depth_.world_from_camera)
            return std::nullopt;
        const Matrix matrix = Eigen::Map<const Matrix>(depth_.world_from_camera + 16 * index);
        if (matrix.hasNaN())
            return std::nullopt;
        const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
        if (!((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-3) ||
            !(rotation.determinant() > 0) || matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
            throw Error(
                fmt::format("pose {}: expected a rotation and a translation, 4x4, row by row, camera to world", index));
        return Eigen::Isometry3d(matrix);
    }

    [[nodiscard]] Frame frame(std::size_t index) const {
        auto* values = static_cast<std::byte*>(const_cast<void*>(depth_.values)); // cv::Mat has no const view
        Frame frame;
        const cv::Mat stored = looking_along_z({size(), depth_.type == SCANSHADE_UINT16 ? CV_16UC1 : CV_32FC1,
                                                values + static_cast<std::int64_t>(index) * image_bytes_,
                                                static_cast<std::size_t>(row_bytes_)},
                                               frame.warnings);
        frame.name = listing_.entries[index].name;
        frame.camera = camera_;
        frame.depth_m = depth_in_metres(stored, encoding_);
        frame.findings = findings_about(frame.depth_m, stored, encoding_);
        frame.world_from_camera = listing_.entries[index].world_from_camera;
        return frame;
    }

    [[nodiscard]] library::Beforehand beforehand(const RunSettings& asked) const {
        std::vector<std::size_t> all(listing_.entries.size());
        std::iota(all.begin(), all.end(), std::size_t{0});
        std::vector<DepthImage> images;
        if (needs_look(asked))
            for (const std::size_t index : spread(5, all.size()))
                images.push_back(project(frame(index)));
        return {look_at(images, asked),
                findings_about(listing_, all, asked, [this](std::size_t index) { return frame(index); }), false};
    }

    scanshade_depth depth_;
    std::int64_t row_bytes_ = 0, image_bytes_ = 0;
    DepthEncoding encoding_;
    Camera camera_;
    Capture listing_;
};

void check_triangles(const scanshade_points& given) {
    for (std::int64_t i = 0; i < 3 * given.triangle_count; ++i)
        if (given.triangles[i] < 0 || given.triangles[i] >= given.count)
            throw Error(fmt::format("triangle {}: point {} given, expected 0 .. {}", i / 3, given.triangles[i],
                                    given.count - 1));
}

library::PointArrays points_from(const scanshade_points* arrays) {
    const scanshade_points given = taken(arrays, sizeof(scanshade_points), "points");
    if (given.count < 1 || given.count > std::numeric_limits<int>::max())
        throw Misuse(fmt::format("points: {} given, expected 1 to {}", given.count, std::numeric_limits<int>::max()));
    require(given.points, "points");
    library::PointArrays points;
    points.points = vectors_from(given.points, given.points_type, given.count, given.points_bytes, "points");
    for (Eigen::Vector3d& point : points.points)
        if (!point.allFinite())
            point.setConstant(std::nan(""));
    if (given.normals)
        points.normals = vectors_from(given.normals, given.normals_type, given.count, given.normals_bytes, "normals");
    if (given.triangle_count > 0) {
        require(given.triangles, "triangles");
        check_triangles(given);
        static_assert(sizeof(std::array<int, 3>) == 3 * sizeof(std::int32_t));
        points.triangles = {reinterpret_cast<const std::array<int, 3>*>(given.triangles),
                            static_cast<std::size_t>(given.triangle_count)};
    }
    if (given.scanner)
        points.scanner = Eigen::Vector3d(given.scanner[0], given.scanner[1], given.scanner[2]);
    points.z_up = given.z_up != 0;
    return points;
}

// ---------------------------------------------------------------------------------------------------- captures

std::string info_of(const Capture& capture) {
    json info{{"path", capture.path.string()}, {"kind", capture.kind}};
    info["camera"] = capture.camera ? to_json(*capture.camera) : json();
    info["depth_scale"] = capture.depth.name;
    info["registered"] = name_of(capture.registration);
    info["warnings"] = capture.warnings;
    info["frames"] = json::array();
    for (const CaptureEntry& entry : capture.entries) {
        json frame{{"name", entry.name}};
        if (entry.stamp_s)
            frame["stamp_s"] = *entry.stamp_s;
        if (!entry.problem.empty())
            frame["problem"] = entry.problem;
        info["frames"].push_back(std::move(frame));
    }
    return json_line(info);
}

} // namespace

extern "C" {

const char* scanshade_version(void) { return SCANSHADE_VERSION; }
const char* scanshade_last_error(void) { return last_error.c_str(); }

const char* scanshade_settings(void) {
    return text_or_null([] {
        static const std::string text = json_line(library::all_settings());
        return text.c_str();
    });
}

const char* scanshade_devices(void) {
    return text_or_null([] {
        thread_local std::string text;
        json list = json::array();
        for (const gpu::DeviceInfo& device : gpu::list_devices())
            list.push_back({{"index", device.index},
                            {"name", device.name},
                            {"kind", device.kind},
                            {"driver", device.driver},
                            {"api", device.api},
                            {"unusable", device.unusable}});
        text = json_line(list);
        return text.c_str();
    });
}

scanshade_status scanshade_session_open(const scanshade_setting* settings, size_t count, scanshade_session** session) {
    return guarded([&] {
        start(session);
        *session = new scanshade_session{library::Session(settings_from(settings, count))};
    });
}

void scanshade_session_close(scanshade_session* session) { delete session; }

const char* scanshade_session_settings(const scanshade_session* session) {
    return session ? session->session.settings_text().c_str() : nullptr;
}

scanshade_status scanshade_compute_depth(scanshade_session* session, const scanshade_depth* depth, uint32_t outputs,
                                         scanshade_result** result) {
    return guarded([&] {
        start(result);
        require(session, "session");
        const DepthFrames frames(depth);
        const library::Source source = frames.source();
        std::vector<std::size_t> all(source.listing.entries.size());
        std::iota(all.begin(), all.end(), std::size_t{0});
        *result = new scanshade_result{session->session.compute(source, all, wanted_from(outputs)), {}, {}};
    });
}

scanshade_status scanshade_compute_points(scanshade_session* session, const scanshade_points* points, uint32_t outputs,
                                          scanshade_result** result) {
    return guarded([&] {
        start(result);
        require(session, "session");
        *result = new scanshade_result{session->session.compute(points_from(points), wanted_from(outputs)), {}, {}};
    });
}

scanshade_status scanshade_compute_frame(scanshade_session* session, const scanshade_frame* frame, uint32_t outputs,
                                         scanshade_result** result) {
    return guarded([&] {
        start(result);
        require(session, "session");
        require(frame, "frame");
        const Capture& capture = frame->opened->capture;
        // A session may keep the source for frames to come, and this one may be freed by then.
        const library::Source source{
            frame->opened, capture,
            [frame = frame->frame, own = frame->index, opened = frame->opened](std::size_t index) {
                return index == own ? frame : opened->capture.load(index, false);
            },
            [opened = frame->opened](const RunSettings& asked, const std::string& key) {
                return opened->beforehand(asked, key);
            }};
        *result = new scanshade_result{
            session->session.compute(source, std::span(&frame->index, 1), wanted_from(outputs)), {}, {}};
    });
}

scanshade_status scanshade_result_arrays(const scanshade_result* result, scanshade_arrays* arrays) {
    return guarded([&] {
        require(result, "result");
        const library::Result& r = result->result;
        const auto values = [](const cv::Mat& image) { return image.empty() ? nullptr : image.ptr<float>(); };
        give(arrays,
             {sizeof(scanshade_arrays), r.count, r.height, r.width, values(r.visibility), values(r.confidence),
              values(r.normals)},
             sizeof(scanshade_arrays), "arrays");
    });
}

const char* scanshade_result_info(const scanshade_result* result) {
    return text_or_null([&] {
        require(result, "result");
        std::call_once(result->described, [&] { result->info = result->result.info(); });
        return result->info.c_str();
    });
}

const char* scanshade_result_doubt(const scanshade_result* result, int64_t image, int64_t number) {
    if (!result || image < 0 || number < 0 || image >= static_cast<int64_t>(result->result.rows.size()))
        return nullptr;
    std::vector<const char*> doubts; // each once
    for (const Finding& finding : result->result.rows[static_cast<std::size_t>(image)].findings)
        if (is_doubt(finding) && std::ranges::find(doubts, finding.sentence) == doubts.end())
            doubts.push_back(finding.sentence.c_str());
    return number < static_cast<int64_t>(doubts.size()) ? doubts[static_cast<std::size_t>(number)] : nullptr;
}

void scanshade_result_free(scanshade_result* result) { delete result; }

scanshade_status scanshade_capture_open(const char* path, const scanshade_setting* settings, size_t count,
                                        scanshade_capture** capture) {
    return guarded([&] {
        start(capture);
        require(path, "path");
        RunSettings asked;
        library::fill(asked, Purpose::capture, settings_from(settings, count));
        auto opened = std::make_shared<const library::OpenedCapture>(open_capture_at_or_below(
            path, {asked.camera, asked.depth_scale, asked.association_limit_s, asked.poses, asked.colour, asked.topic,
                   usual_median_depth, asked.confidence_min, asked.copc}));
        require_metres(opened->capture, "the library"); // its depths and poses are
        std::string info = info_of(opened->capture);
        *capture = new scanshade_capture{std::move(opened), std::move(info)};
    });
}

void scanshade_capture_close(scanshade_capture* capture) { delete capture; }

int64_t scanshade_capture_count(const scanshade_capture* capture) {
    return capture ? static_cast<int64_t>(capture->opened->capture.entries.size()) : 0;
}

const char* scanshade_capture_info(const scanshade_capture* capture) {
    return capture ? capture->info.c_str() : nullptr;
}

scanshade_status scanshade_capture_load(scanshade_capture* capture, int64_t index, scanshade_frame** frame) {
    return guarded([&] {
        start(frame);
        require(capture, "capture");
        if (index < 0 || index >= scanshade_capture_count(capture))
            throw Misuse(fmt::format("frame: {} given, expected 0 .. {}", index, scanshade_capture_count(capture) - 1));
        const auto place = static_cast<std::size_t>(index);
        auto loaded = std::make_unique<scanshade_frame>(
            scanshade_frame{capture->opened, place, capture->opened->capture.load(place), {}, {}});
        const Frame& f = loaded->frame;
        if (f.camera.pinhole.fx != 0)
            loaded->camera = to_c(f.camera);
        if (f.world_from_camera)
            Eigen::Map<Matrix>(loaded->world_from_camera.data()) = f.world_from_camera->matrix();
        *frame = loaded.release();
    });
}

scanshade_status scanshade_frame_get(const scanshade_frame* frame, scanshade_frame_data* data) {
    return guarded([&] {
        require(frame, "frame");
        const Frame& f = frame->frame;
        scanshade_frame_data own = SCANSHADE_FRAME_DATA_INIT;
        own.name = f.name.c_str();
        const cv::Size size = f.cloud ? f.cloud->grid : f.depth_m.size();
        own.width = size.width;
        own.height = size.height;
        if (f.cloud) {
            static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
            own.points = f.cloud->points.empty() ? nullptr : f.cloud->points.front().data();
            if (!f.cloud->colours.empty()) {
                own.colour = f.cloud->colours.front().val;
                own.colour_width = size.width;
                own.colour_height = size.height;
            }
            own.colour_registered = own.colour ? 1 : -1;
        } else {
            own.depth_m = f.depth_m.ptr<float>();
            if (!f.colour.empty()) {
                own.colour = f.colour.ptr();
                own.colour_width = f.colour.cols;
                own.colour_height = f.colour.rows;
            }
            own.colour_registered = f.registration == Registration::unknown ? -1 : f.registration == Registration::yes;
        }
        own.camera = frame->camera ? &*frame->camera : nullptr;
        own.world_from_camera = f.world_from_camera ? frame->world_from_camera.data() : nullptr;
        give(data, own, sizeof(scanshade_frame_data), "frame_data");
    });
}

void scanshade_frame_free(scanshade_frame* frame) { delete frame; }

scanshade_status scanshade_refine(const char* path, const scanshade_setting* settings, size_t count,
                                  scanshade_refinement** refinement) {
    return guarded([&] {
        start(refinement);
        require(path, "path");
        RefineSettings asked;
        library::fill(asked, settings_from(settings, count));
        const Stopwatch stopwatch;
        const RecordingResult found = asked.refine(path);
        const double took_s = stopwatch.seconds();
        *refinement = new scanshade_refinement{to_c(found.file.camera),
                                               camera_as_json(found.file, details_of(found.refinement, took_s).dump()),
                                               summary_of(found.refinement, took_s), trajectory_of(found)};
    });
}

scanshade_status scanshade_refinement_camera(const scanshade_refinement* refinement, scanshade_camera* camera) {
    return guarded([&] {
        require(refinement, "refinement");
        give(camera, refinement->camera, first_camera, "camera");
    });
}

const char* scanshade_refinement_report(const scanshade_refinement* refinement) {
    return refinement ? refinement->report.c_str() : nullptr;
}
const char* scanshade_refinement_summary(const scanshade_refinement* refinement) {
    return refinement ? refinement->summary.c_str() : nullptr;
}
const char* scanshade_refinement_trajectory(const scanshade_refinement* refinement) {
    return refinement ? refinement->trajectory.c_str() : nullptr;
}
void scanshade_refinement_free(scanshade_refinement* refinement) { delete refinement; }

scanshade_status scanshade_relief(const scanshade_heights* heights, const scanshade_setting* settings, size_t count,
                                  scanshade_relief_maps** maps) {
    return guarded([&] {
        start(maps);
        const scanshade_heights given = taken(heights, sizeof(scanshade_heights), "heights");
        const Settings asked = settings_from(settings, count);
        if (given.path) {
            *maps = new scanshade_relief_maps{library::relief_of(given.path, asked)};
            return;
        }
        require(given.values, "heights");
        if (given.type != SCANSHADE_FLOAT32 && given.type != SCANSHADE_FLOAT64)
            throw Misuse(fmt::format("heights: type {} given, expected FLOAT32 or FLOAT64", given.type));
        *maps = new scanshade_relief_maps{library::relief_of(
            {given.values, given.type == SCANSHADE_FLOAT64, {given.width, given.height}, given.row_bytes, given.cell},
            asked)};
    });
}

scanshade_status scanshade_relief_size(const scanshade_relief_maps* maps, int32_t* width, int32_t* height) {
    return guarded([&] {
        require(maps, "maps");
        require(width, "width");
        require(height, "height");
        const cv::Size size = maps->result.maps.front().values.size();
        *width = size.width, *height = size.height;
    });
}

const float* scanshade_relief_map(const scanshade_relief_maps* maps, const char* name) {
    if (!maps || !name)
        return nullptr;
    const auto found = std::ranges::find(maps->result.maps, name, &relief::NamedMap::name);
    return found == maps->result.maps.end() ? nullptr : found->values.ptr<float>();
}

const char* scanshade_relief_info(const scanshade_relief_maps* maps) {
    return maps ? maps->result.info.c_str() : nullptr;
}
void scanshade_relief_free(scanshade_relief_maps* maps) { delete maps; }

} // extern "C"
