#include "apps/walk/large_frames.h"

#include "apps/frame/frame_points.h"
#include "apps/large/survey.h"
#include "apps/walk/cloud_tiles.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/format.h"
#include "projection/base/error.h"
#include "projection/sensor/expected_error.h"

#include <algorithm>
#include <chrono>
#include <fmt/format.h>
#include <iterator>
#include <limits>
#include <set>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <thread>

namespace scanshade {

LargeSettings LargeFrames::settings(const std::string& name) const {
    LargeSettings settings;
    settings.folder = tiles_folder(options_.outputs.folder, name);
    const Outputs& outputs = options_.outputs;
    constexpr std::size_t judged = 65536; // points that tell whether values are to be doubted
    const bool shows = outputs.preview || outputs.shaded || outputs.panel || outputs.glb || outputs.mcap;
    // About 100 bytes each, in memory: no more of them than points that are computed at once.
    const std::size_t most = std::max<std::size_t>(options_.points->most_at_once(), 1000000);
    settings.shown =
        std::clamp<std::size_t>(shows ? outputs.page_points : std::min(outputs.page_points, judged), 1, most);
    constexpr double bytes_per_point = 420;
    const double memory = bytes_per_point * static_cast<double>(options_.points->most_at_once());
    settings.buffers = static_cast<std::size_t>(std::clamp(memory / 4, 8.0 * (1 << 20), 64.0 * (1 << 20)));
    if (options_.stop)
        settings.stop = [stop = options_.stop] { return stop->load(); };
    settings.say = options_.say;
    settings.helps = helps_;
    return settings;
}

bool LargeFrames::by_points() const {
    return options_.points && options_.points->most_at_once() != std::numeric_limits<std::size_t>::max() &&
           options_.cloud_walk != CloudWalk::view && !(capture_.camera && options_.cloud_walk != CloudWalk::points);
}

void LargeFrames::find_surveys() {
    const std::size_t count = capture_.entries.size();
    if (count < 2 || !by_points() || options_.cloud_tiles == CloudTiles::separate)
        return;
    std::vector<std::optional<CloudStream>> streams(count);
    std::vector<std::optional<SurveyTile>> tiles(count);
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t i) {
        const CaptureEntry& entry = capture_.entries[i];
        if (entry.cloud.empty() || entry.world_from_camera || !entry.problem.empty())
            return;
        try {
            std::vector<std::string> unused;
            std::optional<CloudShape> shape = cloud_shape(entry.cloud, unused);
            if (!shape || !shape->whole_since.empty() || shape->records.grid.height > 1 || shape->records.viewpoint)
                return;
            settle_octree(shape->records, capture_.copc);
            CloudStream stream(entry.cloud, *std::move(shape));
            const std::optional<Eigen::AlignedBox3d> box = stream.box();
            if (!box)
                return;
            tiles[i] = {*box,
                        fmt::format("{} {} {}", stream.records().format->z_up ? "LAS" : stream.records().format->name,
                                    normal_fields(stream.records()).has_value(), stream.reference())};
            streams[i] = std::move(stream);
        } catch (const Outage&) {
            throw;
        } catch (const Error&) { // computing the frame reports the error
        }
    });
    std::vector<std::vector<std::size_t>> surveys;
    if (options_.cloud_tiles == CloudTiles::automatic) {
        surveys = surveys_in(tiles);
    } else {
        surveys.emplace_back();
        for (std::size_t i = 0; i < count; ++i)
            if (streams[i])
                surveys.back().push_back(i);
    }
    for (const std::vector<std::size_t>& survey : surveys) {
        constexpr std::size_t most_points = 0x7fffffff; // points are numbered with 32 bits
        std::size_t points = 0;
        for (const std::size_t i : survey)
            points += streams[i]->size();
        if (survey.size() < 2 || points > most_points)
            continue;
        const std::string sentence = fmt::format(
            "{} of {} clouds are tiles of one survey{}: points near borders see those of the neighbours. --tiles "
            "separate computes each by itself.",
            survey.size(), count,
            options_.cloud_tiles == CloudTiles::join ? ", as --tiles join says" : ", since their boxes adjoin");
        if (options_.say)
            options_.say(sentence);
        std::vector<CloudStream> files;
        for (const std::size_t i : survey)
            files.push_back(*streams[i]);
        const auto run = std::make_shared<LargeCloudRun>(
            std::move(files), settings(fmt::format("survey-{}", capture_.entries[survey.front()].name)));
        for (std::size_t k = 0; k < survey.size(); ++k) {
            parts_[survey[k]] = {run, k};
            notes_[survey[k]] = sentence;
        }
    }
}

LargeFrames::Part LargeFrames::part_of(std::size_t index, std::vector<std::string>& warnings,
                                       std::vector<std::string>& notes) {
    const CaptureEntry& entry = capture_.entries[index];
    if (entry.cloud.empty() || !by_points())
        return {};
    // Isolated: while it waits for its own tasks this thread must not begin another frame, which would wait here for
    // it.
    std::call_once(looked_, [&] { tbb::this_task_arena::isolate([&] { find_surveys(); }); });
    if (const auto survey = parts_.find(index); survey != parts_.end()) {
        notes.push_back(notes_.at(index));
        return survey->second;
    }
    std::vector<std::string> about_file;
    std::string why_not;
    std::optional<CloudShape> shape = large_shape(entry.cloud, options_.points->most_at_once(), about_file, why_not);
    if (!shape) {
        if (!helps_)
            remove_left_tiles(tiles_folder(options_.outputs.folder, entry.name));
        if (!why_not.empty())
            notes.push_back(
                fmt::format("more points than --cloud.memory holds; the file is read as a whole, since {}.", why_not));
        return {};
    }
    std::ranges::move(about_file, std::back_inserter(warnings));
    notes.push_back(fmt::format("{} points, more than --cloud.memory holds: computed from disk, in tiles.",
                                shape->records.point_count));
    during(entry.cloud, [&] { settle_octree(shape->records, capture_.copc); });
    std::vector<CloudStream> files;
    files.emplace_back(entry.cloud, *std::move(shape));
    return {std::make_shared<LargeCloudRun>(std::move(files), settings(entry.name)), 0};
}

void help_with_large_clouds(const Capture& capture, const BatchOptions& options, const std::function<bool()>& at_work) {
    LargeFrames frames(capture, options, true);
    std::set<std::shared_ptr<LargeCloudRun>> clouds; // files of a survey have one in common
    for (const std::size_t index : options.frames) {
        std::vector<std::string> warnings, notes; // the other process has them, too
        if (const LargeFrames::Part part = frames.part_of(index, warnings, notes); part.run)
            clouds.insert(part.run);
    }
    const bool any = !clouds.empty();
    while (any && at_work() && !(options.stop && *options.stop)) {
        std::erase_if(clouds, [&](const std::shared_ptr<LargeCloudRun>& cloud) {
            const bool ready = cloud->has_tiles();
            if (ready)
                cloud->compute(*options.points);
            return ready;
        });
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
    }
}

void compute_large(Work& work, PointMethod& method) {
    work.large->compute(method);
    const PointVisibility& found = work.large->found();
    const CloudRecords& records = work.large->file(work.large_file).records();
    if (const std::string unit = unit_of(records); !unit.empty())
        work.row.notes.push_back(fmt::format("coordinates are in {}.", unit));
    std::ranges::copy(found.notes, std::back_inserter(work.row.notes));
    std::ranges::copy(found.findings, std::back_inserter(work.row.findings));
}

void write_large(Work& work, const Outputs& outputs) {
    const CloudRecords& records = work.large->file(work.large_file).records();
    std::optional<std::filesystem::path> target;
    const std::filesystem::path file = cloud_file(written_name(work.entry.name, records), "");
    if (outputs.cloud)
        target = outputs.files_folder() / file;
    LargeCloudRun::Colours colours;
    Cloud shape;
    shape.records = std::make_shared<CloudRecords>(records);
    if (outputs.colour_cloud != CloudColours::kept && takes_colours(shape))
        colours = [&](const std::vector<cv::Vec3b>& own, const std::vector<float>& visibility) {
            return cloud_colours(own, visibility, outputs);
        };
    else if (outputs.cloud && outputs.colour_cloud == CloudColours::grey)
        work.row.warnings.push_back("the file's point format has no colour, so grey is not written; the field "
                                    "ambient_occlusion has the values.");
    std::optional<LargeCloudTiles> tiles;
    LargeCloudRun::Each add_to_tiles;
    if (outputs.tiles3d) {
        tiles.emplace(work, outputs);
        add_to_tiles = [&](const auto& points, const auto& own, const auto& visibility, const auto& error) {
            tiles->add(points, own, visibility, error);
        };
    }
    LargeCloudRun::Result result = work.large->result(work.large_file, target, colours, outputs.error, add_to_tiles);
    if (target)
        work.row.files.push_back(file);
    if (tiles)
        tiles->finish();
    std::ranges::move(result.warnings, std::back_inserter(work.row.warnings));
    work.of_points = std::move(result.of_shown);
    work.frame.name = work.entry.name;
    work.frame.cloud = std::move(result.shown);
    work.frame.world_from_camera = work.entry.world_from_camera;
    if (records.viewpoint)
        work.frame.world_from_camera = records.viewpoint;
    work.confidence.per_point = confidence_of_points(work.of_points.error);
    work.error.per_point = std::move(work.of_points.error);
    work.attached.per_point = work.of_points.visibility;
    const auto share = [](std::size_t part, std::size_t all) {
        return all > 0 ? static_cast<double>(part) / static_cast<double>(all) : 0;
    };
    work.attached.coverage = share(result.known, result.valid);
    work.attached.mean_visibility = result.mean;
    work.row.valid_share = share(result.valid, result.points);
    work.row.passes = work.of_points.timings;
}

} // namespace scanshade
