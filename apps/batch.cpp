// The walk for many frames: load, project, compute, attach, write, with a bounded number of frames in memory.
#include "apps/batch.h"

#include "apps/cloud_walk.h"
#include "apps/picture.h"
#include "io/cloud_file.h"
#include "io/npy_file.h"
#include "io/output_file.h"
#include "projection/attach.h"
#include "projection/colour_view.h"
#include "projection/confidence.h"
#include "projection/error.h"
#include "projection/project.h"
#include "projection/undistort.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <map>
#include <memory>
#include <tbb/info.h>
#include <tbb/parallel_pipeline.h>

namespace scanshade {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// One frame on its way through the pipeline.
struct Work {
    const CaptureEntry& entry;
    FrameRow& row;
    Frame frame = {};
    DepthImage depth = {};
    DepthImage looked_at = {}; ///< of a sequence: what the methods saw in place of `depth`
    std::vector<Intermediate> averaging = {}; ///< over frames, for study
    AoMap ao = {};
    cv::Mat1f confidence_in_view = {}; ///< of `ao`, pixel by pixel
    Attached attached = {}, confidence = {};
    bool wanted = true;     ///< false: loaded for the frames around it
    bool by_points = false; ///< no view: values come from the points themselves
    CloudVisibility of_points = {}; ///< what they are, where a CloudAo found them
};

void blame(FrameRow& row, FrameStatus status, Fault fault, const std::exception& failure) {
    row.status = status;
    row.fault = fault;
    row.why = failure.what();
}

/// Takes one step with a frame and its time; the only place where a frame's failure is caught.
template <class Step>
void take(Work& work, double StageTimes::*stage, Step&& step) {
    if (!work.row.why.empty())
        return;
    const auto start = std::chrono::steady_clock::now();
    try {
        step();
    } catch (const DeviceLost& failure) { // no fault of the frame: another device may do it
        blame(work.row, FrameStatus::skipped, Fault::outage, failure);
    } catch (const Outage& failure) {
        blame(work.row, FrameStatus::failed, Fault::outage, failure);
    } catch (const Error& failure) {
        blame(work.row, FrameStatus::failed, Fault::input, failure);
    } catch (const std::exception& failure) { // while loading, a library's word on the file
        const bool loading = stage == &StageTimes::load || stage == &StageTimes::project;
        blame(work.row, FrameStatus::failed, loading ? Fault::input : Fault::internal, failure);
    }
    work.row.ms.*stage = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

Frame load(const Capture& capture, std::size_t index, const std::optional<Registration>& registration) {
    if (const std::string& problem = capture.entries[index].problem; !problem.empty())
        throw Error(problem);
    Frame frame = capture.load(index);
    if (registration)
        frame.registration = *registration;
    return frame;
}

double share(std::ptrdiff_t part, std::size_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

/// Pixels or points that hold a depth / all of them.
double valid_share(const Frame& frame) {
    if (!frame.cloud)
        return share(cv::countNonZero(frame.depth_m > 0), frame.depth_m.total());
    const auto& points = frame.cloud->points;
    return share(std::count_if(points.begin(), points.end(), [](const auto& p) { return p.allFinite(); }),
                 points.size());
}

void describe_frame(Work& work) {
    const Frame& frame = work.frame;
    FrameRow& row = work.row;
    row.size = frame.cloud ? frame.cloud->grid : frame.depth_m.size();
    row.valid_share = valid_share(frame);
    row.warnings = frame.warnings;
    if (frame.registration == Registration::yes && !frame.cloud && !frame.colour.empty() &&
        frame.colour.size() != frame.depth_m.size())
        row.warnings.push_back(fmt::format("colour is {}x{}, depth {}x{}: shaded shows clay.", frame.colour.cols,
                                           frame.colour.rows, frame.depth_m.cols, frame.depth_m.rows));
}

/// A camera that sees none of the points is a mistake to be told, not an empty result. (No depth at all is a result.)
void refuse_blind_view(const Work& work) {
    if (work.row.valid_share > 0 && cv::countNonZero(work.depth.z_m) == 0)
        throw Error(fmt::format("nothing recorded lies in view of the camera ({}; {})", describe(work.frame.camera),
                                work.frame.camera.origin));
}

/// Every point's value from the points themselves, or from the faces where the file has some.
Attached attach_points(const Frame& frame, PointMethod& method) {
    const Cloud& cloud = *frame.cloud;
    const auto normals = recorded_normals(cloud);
    const auto triangles = triangles_of(cloud);
    return attached_points(cloud, method.compute({cloud.points, normals, triangles}));
}

/// What the pictures of a frame show, all on one pixel grid.
struct Scene {
    cv::Mat1f z_m, visibility;
    cv::Mat3b colour; ///< empty unless it fits the depth
    Pinhole camera;
    cv::Mat1b colour_known = {}; ///< 0 where `colour` has none; empty = known everywhere
    cv::Mat1f confidence = {};   ///< in the colour view; empty = as attached
};

/// Whether colour is carried over from a camera of its own.
bool colour_from_beside(const Frame& frame) {
    return frame.registration != Registration::yes && frame.colour_camera && !frame.colour.empty();
}

/// Colour warped into the depth view, or everything else into the colour view.
Scene scene_beside(const Work& work, bool colour_view) {
    const Frame& frame = work.frame;
    const SurfaceInColour surface = surface_in_colour(frame.depth_m, frame.camera, *frame.colour_camera);
    if (colour_view) {
        const cv::Mat1f& confidence = work.confidence.visibility;
        return {surface.z_m,  on_colour_pixels(work.attached.visibility, surface),
                frame.colour, frame.colour_camera->camera.pinhole,
                {},           confidence.empty() ? cv::Mat1f() : on_colour_pixels(confidence, surface)};
    }
    const auto [colour, known] =
        colour_on_depth(frame.colour, frame.depth_m, frame.camera, *frame.colour_camera, surface);
    return {frame.depth_m, work.attached.visibility, colour, frame.camera.pinhole, known};
}

cv::Mat3b colour_in_view(const Cloud& cloud, const DepthImage& depth) {
    if (cloud.colours.empty())
        return {};
    cv::Mat3b colour(depth.z_m.size(), cv::Vec3b(64, 40, 28));
    std::transform(depth.source.begin(), depth.source.end(), colour.begin(), colour.begin(),
                   [&](int point, const cv::Vec3b& none) { return point < 0 ? none : cloud.colours[point]; });
    return colour;
}

/// Values of an organised cloud's points as an image; shares their memory.
template <class Pixel>
cv::Mat_<Pixel> on_grid(const std::vector<Pixel>& values, cv::Size grid) {
    return cv::Mat_<Pixel>(grid.height, grid.width, const_cast<Pixel*>(values.data()));
}

cv::Mat1f depth_on_grid(const Cloud& cloud) {
    cv::Mat1f z_m(cloud.grid);
    std::transform(cloud.points.begin(), cloud.points.end(), z_m.begin(),
                   [](const Eigen::Vector3d& p) { return p.allFinite() ? static_cast<float>(p.z()) : 0.0f; });
    return z_m;
}

/// A depth frame is shown on its recorded pixels, an organised cloud on its grid, other clouds as projected.
/// A point's colour is its own; a depth pixel's colour is claimed only where the images are registered, or where it is
/// known how the colour camera stands beside the depth camera.
Scene scene_of(const Work& work, bool colour_view) {
    const Frame& frame = work.frame;
    const cv::Mat1f& visibility = work.attached.visibility;
    if (!frame.cloud) {
        if (colour_from_beside(frame))
            return scene_beside(work, colour_view);
        const bool fits = frame.registration == Registration::yes && frame.colour.size() == frame.depth_m.size();
        return {frame.depth_m, visibility, fits ? frame.colour : cv::Mat3b(), frame.camera.pinhole};
    }
    const Cloud& cloud = *frame.cloud;
    if (!cloud.organised())
        return {work.depth.z_m, visibility, colour_in_view(cloud, work.depth), work.depth.camera};
    const cv::Mat3b colour = cloud.colours.empty() ? cv::Mat3b() : on_grid(cloud.colours, cloud.grid);
    return {depth_on_grid(cloud), visibility, colour, frame.camera.pinhole};
}

/// Clay has no pixel colours to keep where there is no surface, so both kinds go through the same multiplication.
/// What the colour camera did not see is clay, too.
cv::Mat3b shaded_picture(const Scene& scene, double strength) {
    cv::Mat3b base = scene.colour;
    if (base.empty() || !scene.colour_known.empty())
        base = clay(scene.z_m, scene.camera);
    if (!scene.colour_known.empty())
        scene.colour.copyTo(base, scene.colour_known);
    return shade(base, scene.visibility, strength);
}

cv::Mat3b panel_picture(const Frame& frame, const Scene& scene, const cv::Mat3b& shaded) {
    const bool fits = !scene.colour.empty();
    const std::string colour = fits                   ? "colour"
                               : frame.colour.empty() ? "no colour"
                                                      : "colour (not known to fit the depth)";
    return panel({{colour, fits ? scene.colour : frame.colour},
                  {"depth", depth_picture(scene.z_m)},
                  {"ambient occlusion", visibility_picture(scene.visibility)},
                  {fits ? "colour x AO" : "clay x AO", shaded}});
}

std::vector<cv::Vec3b> shaded_colours(const std::vector<cv::Vec3b>& colours, const std::vector<float>& visibility,
                                      double strength) {
    const cv::Size row(static_cast<int>(colours.size()), 1);
    if (row.empty())
        return {};
    const cv::Mat3b shaded = shade(on_grid(colours, row), on_grid(visibility, row), strength);
    return {shaded.begin(), shaded.end()};
}

/// What each undistorted pixel shows of an image; the lens bends where to look. Zero where it saw nothing.
template <class Pixel>
cv::Mat_<Pixel> undistorted_image(const cv::Mat_<Pixel>& image, const Camera& camera) {
    if (image.empty() || !camera.distortion.any())
        return image;
    const auto maps = Undistortion::of(camera);
    cv::Mat_<Pixel> straight(image.size());
    std::transform(maps->recorded_pixel().begin(), maps->recorded_pixel().end(), straight.begin(),
                   [&](int pixel) { return pixel < 0 ? Pixel() : image(pixel / image.cols, pixel % image.cols); });
    return straight;
}

/// In clouds, where nothing is known of a point it has no confidence.
float known_or_none(float confidence) { return std::isnan(confidence) ? 0.0F : confidence; }

/// The depth frame's surface as points in camera space, coloured where the colour fits. Points that the colour camera
/// did not see are black, and colour_known says 0.
void write_depth_cloud(const std::filesystem::path& file, const Work& work, const Scene& shown,
                       const Outputs& outputs) {
    const auto& [camera, z_m, source] = work.depth;
    const bool beside = colour_from_beside(work.frame);
    const Scene scene = beside && outputs.colour_view ? scene_beside(work, false) : shown;
    const cv::Mat3b colour = undistorted_image(scene.colour, work.frame.camera);
    const cv::Mat1b colour_known = undistorted_image(scene.colour_known, work.frame.camera);
    std::vector<Eigen::Vector3d> points;
    std::vector<cv::Vec3b> colours;
    std::vector<float> visibility, confidence, known;
    for (int v = 0; v < z_m.rows; ++v) {
        for (int u = 0; u < z_m.cols; ++u) {
            const double z = z_m(v, u);
            if (z <= 0)
                continue;
            points.emplace_back((u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z);
            visibility.push_back(work.ao.visibility(v, u));
            confidence.push_back(known_or_none(work.confidence_in_view(v, u)));
            if (!colour.empty())
                colours.push_back(colour(v, u));
            if (!colour_known.empty())
                known.push_back(colour_known(v, u) > 0 ? 1.0F : 0.0F);
        }
    }
    if (outputs.colour_cloud)
        colours = shaded_colours(colours, visibility, outputs.shade_strength);
    std::vector<AddedField> added = {{"ambient_occlusion", visibility}, {"ao_confidence", confidence}};
    if (beside)
        added.push_back({"colour_known", known});
    write_new_ply(file, points, colours, added, {"camera space: x right, y down, z forward, metres"});
}

void write_recorded_cloud(const std::filesystem::path& file, const Work& work, const Outputs& outputs) {
    const Cloud& cloud = *work.frame.cloud;
    std::vector<cv::Vec3b> colours;
    if (outputs.colour_cloud)
        colours = shaded_colours(cloud.colours, work.attached.per_point, outputs.shade_strength);
    std::vector<AddedField> fields{{"ambient_occlusion", work.attached.per_point}};
    std::vector<float> confidence = work.confidence.per_point;
    std::ranges::transform(confidence, confidence.begin(), known_or_none);
    if (!confidence.empty())
        fields.push_back({"ao_confidence", confidence});
    write_cloud(file, cloud, fields, colours);
}

std::filesystem::path ao_file(const std::string& name, const Outputs& outputs) {
    return std::filesystem::path("ao") / (name + extension(outputs.format));
}
std::filesystem::path confidence_file(const std::string& name, const Outputs& outputs) {
    return std::filesystem::path("confidence") / (name + extension(outputs.format));
}
std::filesystem::path picture_file(const char* kind, const std::string& name) {
    return std::filesystem::path(kind) / (name + ".png");
}
std::filesystem::path cloud_file(const std::string& name, const std::string& extension) {
    return std::filesystem::path("clouds") / (name + extension);
}

void write_all(Work& work, const Scene& scene, const cv::Mat3b& shaded, const Outputs& outputs) {
    const std::string& name = work.entry.name;
    const auto wrote = [&](const std::filesystem::path& file, const auto& write) {
        write(outputs.folder / file);
        work.row.files.push_back(file);
    };
    if (outputs.ao)
        wrote(ao_file(name, outputs), [&](const auto& file) { write_ao(file, scene.visibility, outputs.format); });
    if (outputs.confidence)
        wrote(confidence_file(name, outputs), [&](const auto& file) {
            const bool floats = outputs.format == AoFormat::tiff || outputs.format == AoFormat::exr;
            write_ao(file, scene.confidence.empty() ? work.confidence.visibility : scene.confidence,
                     floats ? outputs.format : AoFormat::png8);
        });
    if (outputs.shaded)
        wrote(picture_file("shaded", name), [&](const auto& file) { write_picture(file, shaded); });
    if (outputs.panel)
        wrote(picture_file("panel", name),
              [&](const auto& file) { write_picture(file, panel_picture(work.frame, scene, shaded)); });
    if (work.frame.cloud && outputs.cloud)
        wrote(cloud_file(name, extension(*work.frame.cloud->records)),
              [&](const auto& file) { write_recorded_cloud(file, work, outputs); });
    if (!work.frame.cloud && outputs.depth_cloud)
        wrote(cloud_file(name, ".ply"), [&](const auto& file) { write_depth_cloud(file, work, scene, outputs); });
}

/// A cloud without a view, as it looks from two opposite sides.
void write_sides(Work& work, const Outputs& outputs) {
    const std::filesystem::path file = picture_file("shaded", work.entry.name);
    write_picture(outputs.folder / file,
                  two_sides(*work.frame.cloud, work.of_points, outputs.shade_strength));
    work.row.files.push_back(file);
}

/// A failed frame leaves neither part of its own files nor those of an earlier run: what lies there is what the row
/// says.
void remove_files(Work& work, const Outputs& outputs) {
    work.row.files.clear();
    for (const auto& file : files_of(work.entry, outputs)) {
        std::error_code gone_already;
        std::filesystem::remove(file, gone_already);
    }
}

/// Every array as .npy, and index.csv that says what they are.
void write_intermediates(const std::filesystem::path& folder, const std::vector<Intermediate>& all) {
    std::string index = "name,type,shape,meaning\n";
    for (const Intermediate& each : all) {
        write_npy(folder / (each.name + ".npy"), each.type, each.shape, each.data);
        index += fmt::format("{},{},{},\"{}\"\n", each.name, each.type, fmt::join(each.shape, "x"), each.meaning);
    }
    write_atomically(folder / "index.csv", index);
}

bool wants_confidence(const Work& work, const BatchOptions& options) {
    const Outputs& outputs = options.outputs;
    return options.cloud || outputs.confidence || (work.frame.cloud ? outputs.cloud : outputs.depth_cloud);
}

void attach_and_write(Work& work, const BatchOptions& options) {
    Outputs outputs = options.outputs;
    const bool by_points = work.by_points;
    if (by_points)
        outputs.ao = outputs.confidence = outputs.shaded = outputs.panel = false;
    Scene scene;
    cv::Mat3b shaded;
    take(work, &StageTimes::attach, [&] {
        if (!by_points)
            work.attached = attach(work.frame, work.depth, work.ao);
        if (!by_points && wants_confidence(work, options)) {
            work.confidence_in_view = confidence_of(work.depth, work.ao.visibility, options.radius_m, options.noise);
            work.confidence = attach(work.frame, work.depth, {work.confidence_in_view});
        }
        work.row.coverage = work.attached.coverage;
        work.row.mean_visibility = work.attached.mean_visibility;
        if (!by_points)
            scene = scene_of(work, outputs.colour_view);
        if (outputs.shaded || outputs.panel)
            shaded = shaded_picture(scene, outputs.shade_strength);
    });
    take(work, &StageTimes::write, [&] {
        write_all(work, scene, shaded, outputs);
        if (by_points && options.outputs.shaded && !work.of_points.visibility.empty())
            write_sides(work, options.outputs);
    });
    if (!work.row.why.empty())
        remove_files(work, outputs);
    else
        work.row.status = FrameStatus::ok;
}

using Token = std::shared_ptr<Work>;

/// Which frames enter the pipeline: those wanted, as they come; with a reach, in the recording's order, those wanted and those
/// within reach of one, then as many empty tokens as frames may still wait for what lies around them.
class Walk {
  public:
    Walk(const Capture& capture, std::vector<FrameRow>& rows, std::size_t reach) : capture_(capture), empty_(reach > 0 ? rows.size() : 0) {
        std::map<std::size_t, FrameRow*> around;
        for (FrameRow& row : rows) {
            const std::size_t first = row.index - std::min(row.index, reach);
            for (std::size_t i = first; reach > 0 && i <= std::min(row.index + reach, capture.entries.size() - 1); ++i)
                around.try_emplace(i, nullptr);
            if (reach > 0)
                around[row.index] = &row;
            else
                steps_.emplace_back(row.index, &row);
        }
        steps_.insert(steps_.end(), around.begin(), around.end());
    }
    [[nodiscard]] bool goes_on() const { return next_ < steps_.size() || empty_ > 0; }
    [[nodiscard]] Token next() {
        if (next_ == steps_.size()) {
            --empty_;
            return {};
        }
        const auto [index, row] = steps_[next_++];
        if (!row)
            beside_.push_back(skipped_row(capture_, index));
        auto work = std::make_shared<Work>(Work{capture_.entries[index], row ? *row : beside_.back()});
        work->row.why.clear();
        work->wanted = row != nullptr;
        return work;
    }

  private:
    const Capture& capture_;
    std::vector<std::pair<std::size_t, FrameRow*>> steps_; ///< null: only beside others
    std::size_t next_ = 0;
    std::deque<FrameRow> beside_; ///< rows of those
    std::size_t empty_;
};

/// Frames of a sequence, held back until what lies around them has arrived. Without a sequence they pass as they come.
class Waiting {
  public:
    explicit Waiting(Neighbourhood* sequence) : sequence_(sequence) {}

    /// Takes a frame (or none, when all have come) and gives the next one that is complete, or none.
    [[nodiscard]] Token pass(Token arrived) {
        if (!sequence_)
            return arrived;
        if (arrived) {
            newest_ = arrived->row.index;
            if (arrived->row.why.empty() && !arrived->by_points)
                sequence_->add(newest_, arrived->depth, arrived->frame.world_from_camera);
            if (arrived->wanted)
                queue_.push_back(std::move(arrived));
        } else {
            newest_ = std::numeric_limits<std::size_t>::max();
        }
        if (queue_.empty() || newest_ - queue_.front()->row.index < sequence_->reach())
            return {};
        Token complete = std::move(queue_.front());
        queue_.pop_front();
        sequence_->forget_before(complete->row.index - std::min(complete->row.index, sequence_->reach()));
        return complete;
    }
    [[nodiscard]] const std::deque<Token>& rest() const { return queue_; }

  private:
    Neighbourhood* sequence_;
    std::size_t newest_ = 0;
    std::deque<Token> queue_;
};

Intermediate map_for_study(std::string name, const cv::Mat1f& map, std::string meaning) {
    const auto* const first = reinterpret_cast<const std::byte*>(map.data);
    return {std::move(name), "f4", {map.rows, map.cols}, {first, first + map.total() * 4}, std::move(meaning)};
}

void compute_view(Work& work, const Capture& capture, Method& method, Neighbourhood* sequence) {
    if (!sequence) {
        work.ao = method.compute({work.depth});
        work.row.passes = method.timings();
        return;
    }
    NeighbourhoodResult result = sequence->compute(work.row.index);
    work.ao = std::move(result.ao);
    work.looked_at = std::move(result.depth);
    if (!result.frames.empty())
        work.averaging = {map_for_study("averaged_frames", result.frames, "frames averaged, counted in views as good as this one"),
                          map_for_study("averaged_deviation", result.deviation, "standard deviation of visibility between them")};
    work.row.passes = std::move(result.timings);
    const auto names = [&](const std::vector<std::size_t>& places) {
        std::vector<std::string> all;
        for (const std::size_t place : places)
            all.push_back(capture.entries[place].name);
        return fmt::format("{}", fmt::join(all, ", "));
    };
    if (!result.fused.empty())
        work.row.notes.push_back("depth is averaged with frames " + names(result.fused) + ".");
    if (!result.neighbours.empty())
        work.row.notes.push_back("surfaces of frames " + names(result.neighbours) + " occlude, too.");
    if (!result.averaged.empty())
        work.row.notes.push_back("visibility is averaged with frames " + names(result.averaged) + ".");
    for (const LeftOut& other : result.left_out)
        work.row.notes.push_back(fmt::format("frame {} is left out: {:.0f} % of its surfaces meet this one's, {:.0f} % contradict it, "
                                             "{:.1f} of the tolerable misfit.", capture.entries[other.place].name, 100 * other.agreement.overlap,
                                             100 * other.agreement.contradicted, other.agreement.misfit));
}

void add_to(RecordingCloud& cloud, const Work& work) {
    if (!work.frame.world_from_camera || work.looked_at.z_m.empty())
        return;
    const Scene scene = scene_of(work, false);
    cloud.add({work.looked_at, work.ao.visibility, work.confidence_in_view, undistorted_image(scene.colour, work.frame.camera),
               undistorted_image(scene.colour_known, work.frame.camera), *work.frame.world_from_camera});
}

std::vector<FrameRow> planned_rows(const Capture& capture, const std::vector<std::size_t>& frames) {
    std::vector<FrameRow> rows;
    for (const std::size_t index : frames)
        rows.push_back(skipped_row(capture, index));
    return rows;
}

} // namespace

std::string_view name_of(FrameStatus status) {
    switch (status) {
    case FrameStatus::ok:
        return "ok";
    case FrameStatus::failed:
        return "failed";
    case FrameStatus::skipped:
        return "skipped";
    }
    return "";
}

StageTimes operator+(const StageTimes& a, const StageTimes& b) {
    const auto sum = [](double x, double y) { return (std::isnan(x) ? 0 : x) + (std::isnan(y) ? 0 : y); };
    return {sum(a.load, b.load), sum(a.project, b.project), sum(a.compute, b.compute), sum(a.attach, b.attach),
            sum(a.write, b.write)};
}

std::string_view name_of(Fault fault) {
    switch (fault) {
    case Fault::none:
        return "none";
    case Fault::input:
        return "input";
    case Fault::outage:
        return "outage";
    case Fault::internal:
        return "internal";
    case Fault::crash:
        return "crash";
    }
    return "";
}

std::vector<std::filesystem::path> files_of(const CaptureEntry& entry, const Outputs& outputs) {
    std::vector<std::filesystem::path> files;
    const auto add = [&](const std::filesystem::path& file) { files.push_back(outputs.folder / file); };
    if (outputs.ao)
        add(ao_file(entry.name, outputs));
    if (outputs.confidence)
        add(confidence_file(entry.name, outputs));
    if (outputs.shaded)
        add(picture_file("shaded", entry.name));
    if (outputs.panel)
        add(picture_file("panel", entry.name));
    if (entry.cloud.empty() ? outputs.depth_cloud : outputs.cloud)
        add(cloud_file(entry.name, ".ply"));
    if (!entry.cloud.empty() && outputs.cloud)
        for (const char* other : {".pcd", ".las", ".xyz", ".pts", ".ptx"})
            add(cloud_file(entry.name, other));
    return files;
}

FrameRow skipped_row(const Capture& capture, std::size_t index) {
    FrameRow row;
    row.index = index;
    row.name = capture.entries.at(index).name;
    row.why = "interrupted";
    row.valid_share = row.coverage = row.mean_visibility = unknown;
    row.ms = {unknown, unknown, unknown, unknown, unknown};
    return row;
}

std::vector<FrameRow> run_batch(const Capture& capture, Method& method, const BatchOptions& options,
                                const std::function<void(const FrameRow&)>& on_frame) {
    std::vector<FrameRow> rows = planned_rows(capture, options.frames);
    Walk walk(capture, rows, options.sequence ? options.sequence->reach() : 0);
    std::atomic<bool> given_up = false;

    const auto begin = [&](tbb::flow_control& flow) -> Token {
        if (!walk.goes_on() || (options.stop && *options.stop) || given_up) {
            flow.stop();
            return {};
        }
        return walk.next();
    };
    const auto load_and_project = [&](Token work) {
        if (!work)
            return work;
        take(*work, &StageTimes::load, [&] {
            work->frame = load(capture, work->row.index, options.registration);
            describe_frame(*work);
        });
        if (work->row.status != FrameStatus::failed && work->frame.cloud)
            work->by_points = options.point_method || takes_points(work->frame, options, work->row.notes);
        if (work->by_points) {
            work->row.ms.project = 0;
            return work;
        }
        take(*work, &StageTimes::project, [&] {
            work->frame.camera = work->row.camera = camera_of(work->frame);
            work->depth = project(work->frame, options.range);
            refuse_blind_view(*work);
        });
        return work;
    };
    Waiting waiting(options.sequence);
    const auto compute = [&](Token arrived) {
        Token work = waiting.pass(std::move(arrived));
        if (!work)
            return work;
        take(*work, &StageTimes::compute, [&] {
            if (work->by_points && options.point_method) {
                work->attached = attach_points(work->frame, *options.point_method);
                if (!options.dump.empty())
                    write_intermediates(options.dump / work->entry.name, options.point_method->intermediates());
                return;
            }
            if (work->by_points) {
                work->of_points = cloud_visibility(work->frame, *options.cloud_ao);
                std::ranges::copy(work->of_points.notes, std::back_inserter(work->row.notes));
                work->confidence.per_point = work->of_points.confidence;
                work->row.passes = work->of_points.timings;
                work->attached = attached_points(*work->frame.cloud, work->of_points.visibility);
                return;
            }
            compute_view(*work, capture, method, options.sequence);
            if (!options.dump.empty()) {
                std::vector<Intermediate> all = method.intermediates();
                std::ranges::move(work->averaging, std::back_inserter(all));
                write_intermediates(options.dump / work->entry.name, all);
            }
        });
        given_up = given_up || (work->row.status == FrameStatus::skipped && work->row.fault == Fault::outage);
        return work;
    };
    const auto finish = [&](Token work) {
        if (work)
            attach_and_write(*work, options);
        return work;
    };
    int outages = 0; // in a row: a full disk does not empty itself, and whoever goes on wastes the rest
    const auto report = [&](const Token& work) { // the images end here
        if (!work)
            return;
        if (options.cloud && work->row.status == FrameStatus::ok)
            add_to(*options.cloud, *work);
        const FrameRow* const row = &work->row;
        outages = row->fault == Fault::outage ? outages + 1 : 0;
        given_up = given_up || outages >= 4;
        if (on_frame)
            on_frame(*row);
    };

    using tbb::filter_mode;
    const int in_memory =
        options.frames_in_memory > 0 ? options.frames_in_memory : tbb::info::default_concurrency() + 2;
    tbb::parallel_pipeline(static_cast<std::size_t>(in_memory),
                           tbb::make_filter<void, Token>(filter_mode::serial_in_order, begin) &
                               tbb::make_filter<Token, Token>(filter_mode::parallel, load_and_project) &
                               tbb::make_filter<Token, Token>(filter_mode::serial_in_order, compute) &
                               tbb::make_filter<Token, Token>(filter_mode::parallel, finish) &
                               tbb::make_filter<Token, void>(filter_mode::serial_in_order, report));
    for (const Token& unfinished : waiting.rest()) // interrupted before what lies around them was there
        unfinished->row = skipped_row(capture, unfinished->row.index);
    return rows;
}

} // namespace scanshade
