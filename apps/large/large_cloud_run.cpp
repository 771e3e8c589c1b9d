// A large cloud from its files to its files.
#include "apps/large/large_cloud_run.h"

#include "apps/large/cloud_files.h"
#include "apps/large/tiles_on_disk.h"
#include "io/content_hash.h"
#include "io/output_file.h"
#include "projection/base/error.h"
#include "projection/sensor/expected_error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <system_error>
#include <utility>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// The files as they are now.
std::string stamps_of(const std::vector<CloudStream>& files) {
    std::string all;
    for (const CloudStream& file : files)
        all += fmt::format("{} {}\n", fs::absolute(file.file()).string(), stamp_of(file.file()));
    return all;
}

} // namespace

fs::path tiles_folder(const fs::path& results, const std::string& name) {
    return results / (".tiles-" + shortened(name, 200));
}

std::optional<CloudShape> large_shape(const fs::path& file, std::size_t most_at_once,
                                      std::vector<std::string>& warnings, std::string& why_not) {
    try {
        std::optional<CloudShape> shape = cloud_shape(file, warnings);
        if (!shape || shape->records.point_count <= most_at_once || shape->records.grid.height > 1)
            return std::nullopt;
        if (shape->whole_since.empty())
            return shape;
        why_not = shape->whole_since;
    } catch (const Outage&) {
        throw;
    } catch (const Error&) { // loading it reports the error
    }
    return std::nullopt;
}

bool is_large_cloud(const fs::path& file, std::size_t most_at_once) {
    std::vector<std::string> warnings;
    std::string why_not;
    return large_shape(file, most_at_once, warnings, why_not).has_value();
}

void remove_left_tiles(const fs::path& folder) {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
}

LargeCloudRun::LargeCloudRun(std::vector<CloudStream> files, LargeSettings settings)
    : source_(std::make_unique<CloudFiles>(std::move(files))), settings_(std::move(settings)), kept_(settings_.helps) {}

LargeCloudRun::~LargeCloudRun() {
    tiles_.reset();
    if (!kept_)
        remove_left_tiles(settings_.folder);
}

std::size_t LargeCloudRun::files() const { return source_->files().size(); }
const CloudStream& LargeCloudRun::file(std::size_t index) const { return source_->files()[index]; }

bool LargeCloudRun::has_tiles() const {
    std::error_code ignored;
    return fs::exists(settings_.folder / "index", ignored);
}

void LargeCloudRun::compute(PointMethod& method) {
    const std::lock_guard alone(mutex_);
    if (computed_)
        return;
    std::uint64_t output = 0;
    for (const CloudStream& file : source_->files())
        output += fs::file_size(file.file()) + 8 * file.size();
    const double shown = static_cast<double>(settings_.shown) * static_cast<double>(files());
    const std::string key =
        fmt::format("{}\n{}\n{}\n{}", SCANSHADE_VERSION, method.fingerprint(), shown, stamps_of(source_->files()));
    tiles_ = std::make_unique<TilesOnDisk>(settings_.folder, key, source_->size(), output, settings_.buffers,
                                           settings_.say, settings_.helps);
    try {
        found_ = method.compute_large(*source_, *tiles_, shown, settings_.stop);
    } catch (const Outage&) {
        if (settings_.stop && settings_.stop()) // the tiles that are done are worth keeping
            keep();
        throw;
    }
    computed_ = true;
}

LargeCloudRun::Result LargeCloudRun::result(std::size_t index, const std::optional<fs::path>& target,
                                            const Colours& colours, bool with_errors, const Each& each) const {
    const CloudStream& stream = file(index);
    const std::size_t start = source_->start(index);
    ValuesInOrder values(*tiles_);
    values.seek(start);
    const std::vector<ValuesInOrder::Shown> shown = values.shown(start, start + stream.size());
    Result result;
    result.warnings = source_->warnings(index);
    result.of_shown = found_;
    PointVisibility& of_shown = result.of_shown;
    auto records = std::make_shared<CloudRecords>(stream.records());
    records->before.clear();
    records->viewpoint = stream.records().viewpoint;
    of_shown.visibility.reserve(shown.size());
    of_shown.error.reserve(shown.size());
    of_shown.normals.reserve(shown.size());
    result.shown.points.reserve(shown.size());
    result.shown.colours.reserve(source_->coloured(index) ? shown.size() : 0);
    records->points.reserve(shown.size() * stream.records().stride);
    std::size_t next = 0; // of those shown
    double sum = 0;
    std::vector<float> visibility, error;
    const auto look_at = [&](std::size_t first, const CloudRecords& block) {
        PointOddities odd;
        const std::vector<Eigen::Vector3d> points = points_of(block, odd);
        values.read(start + first, block.point_count, visibility, error);
        result.points += odd.all;
        result.valid += odd.all - odd.unusable;
        for (const float value : visibility)
            if (!std::isnan(value)) {
                ++result.known;
                sum += static_cast<double>(value);
            }
        std::vector<cv::Vec3b> own = source_->coloured(index) ? colours_of(block) : std::vector<cv::Vec3b>();
        if (each)
            each(points, own, visibility, error);
        for (; next < shown.size() && shown[next].number < start + first + block.point_count; ++next) {
            const std::size_t i = shown[next].number - start - first;
            result.shown.points.push_back(points[i]);
            if (!own.empty())
                result.shown.colours.push_back(own[i]);
            records->points += block.record(i);
            of_shown.visibility.push_back(visibility[i]);
            of_shown.error.push_back(error[i]);
            of_shown.normals.push_back(shown[next].normal);
        }
        return own;
    };
    std::vector<std::string> names{"ambient_occlusion", "ao_confidence"};
    if (with_errors)
        names.emplace_back("ao_error");
    if (target)
        stream.write(*target, names, [&](std::size_t first, const CloudRecords& block) -> CloudStream::BlockValues {
            const std::vector<cv::Vec3b> own = look_at(first, block);
            std::vector<std::vector<float>> fields{visibility, confidence_of_points(error)};
            if (with_errors)
                fields.push_back(error);
            return {std::move(fields), colours ? colours(own, visibility) : std::vector<cv::Vec3b>()};
        });
    else
        stream.pass([&](std::size_t first, const CloudRecords& block) { (void)look_at(first, block); });
    result.mean = result.known > 0 ? sum / static_cast<double>(result.known) : std::numeric_limits<double>::quiet_NaN();
    // Some of the records, as a cloud of its own without what stands round them.
    records->point_count = result.shown.points.size();
    records->grid = result.shown.grid = {static_cast<int>(records->point_count), 1};
    if (records->header.starts_with("ply"))
        records->header = "ply\nformat binary_little_endian 1.0\nend_header\n";
    result.shown.records = std::move(records);
    return result;
}

} // namespace scanshade
