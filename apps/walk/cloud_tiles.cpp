#include "apps/walk/cloud_tiles.h"

#include "apps/frame/frame_points.h"
#include "apps/picture.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/tiles3d.h"
#include "io/rasters/geocentric.h"
#include "io/rasters/las_crs.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/sensor/expected_error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

rasters::Crs crs_of(const CloudRecords* records, const Outputs& outputs) {
    if (!outputs.tiles_crs.empty())
        return rasters::crs_of_code(outputs.tiles_crs);
    if (records && records->header.starts_with("LASF"))
        return rasters::crs_of_las(records->header);
    return {};
}

/// Axes amid the points, east, north and up, where their coordinate system is known; else their own.
class TileAxes {
  public:
    /// `middle`: of the points, in their coordinates.
    TileAxes(const CloudRecords* records, const Vector3d& middle, const Outputs& outputs, FrameRow& row) : row_(row) {
        try {
            const rasters::Crs crs = crs_of(records, outputs);
            if (!crs.known)
                throw Error("the cloud has no coordinate system");
            rasters::Geocentric earth(crs);
            Vector3d origin = middle;
            earth.place({&origin, 1});
            if (!origin.allFinite())
                throw Error(fmt::format("the cloud has no place in {}", earth.system()));
            earth_from_tiles_ = rasters::east_north_up(origin);
            row.notes.push_back(fmt::format("tiles are on the Earth by {}.", earth.system()));
            if (!earth.heights().empty())
                row.notes.push_back(earth.heights());
            earth_.emplace(std::move(earth));
        } catch (const Outage&) {
            throw;
        } catch (const Error& none) {
            row.warnings.push_back(fmt::format("{}: tiles are local, a globe shows them at the Earth's centre; "
                                               "--tiles-crs EPSG:n names the coordinates' system.",
                                               none.what()));
        }
    }
    /// Empty: they stay where they are.
    [[nodiscard]] std::vector<Vector3d> placed(std::span<const Vector3d> points) {
        if (!earth_)
            return {};
        std::vector<Vector3d> placed(points.begin(), points.end());
        earth_->place(placed);
        const Eigen::Isometry3d tiles_from_earth = earth_from_tiles_->inverse();
        for (std::size_t i = 0; i < placed.size(); ++i) {
            lost_ += points[i].allFinite() && !placed[i].allFinite();
            placed[i] = tiles_from_earth * placed[i];
        }
        return placed;
    }
    /// After the last points.
    [[nodiscard]] const std::optional<Eigen::Isometry3d>& earth_from_tiles() const {
        if (lost_ > 0)
            row_.warnings.push_back(
                fmt::format("{} without a place in {}, left out of tiles.", counted(lost_, "point"), earth_->system()));
        return earth_from_tiles_;
    }

  private:
    FrameRow& row_;
    std::optional<rasters::Geocentric> earth_;
    std::optional<Eigen::Isometry3d> earth_from_tiles_;
    std::size_t lost_ = 0;
};

/// Points with what tiles show of them. Refers to its arguments, and to itself.
struct TilePoints {
    std::vector<Vector3d> placed;
    std::vector<cv::Vec3b> colours;
    std::vector<float> visibility, confidence;
    TilesetScene scene;

    TilePoints(std::span<const Vector3d> points, FramePoints&& all, TileAxes& axes)
        : placed(axes.placed(points)), colours(std::move(all.colours)), visibility(std::move(all.visibility)),
          confidence(std::move(all.confidence)) {
        if (colours.empty())
            colours = greys(visibility);
        for (std::size_t i = 0; i < visibility.size(); ++i)
            if (std::isnan(visibility[i])) { // formats of tiles have no NaN
                visibility[i] = 1;
                if (!confidence.empty())
                    confidence[i] = 0;
            }
        scene.points = placed.empty() ? points : placed;
        scene.colours = colours;
        scene.fields = {{"_AMBIENT_OCCLUSION", visibility}};
        if (!confidence.empty())
            scene.fields.push_back({"_AO_CONFIDENCE", confidence});
    }
    TilePoints(const TilePoints&) = delete;
    TilePoints& operator=(const TilePoints&) = delete;
};

void report(const TilesWritten& written, const fs::path& folder, FrameRow& row) {
    for (const fs::path& file : written.files)
        row.files.push_back(folder / file);
    row.notes.push_back(fmt::format("{}: {} in {}, {}.", folder.generic_string(), counted(written.points, "point"),
                                    counted(written.tiles, "tile"),
                                    counted(static_cast<std::size_t>(written.levels), "level")));
}

/// A failure is a warning where other files were written.
template <class Write>
void write_if_possible(FrameRow& row, const Write& write) {
    try {
        write();
    } catch (const Outage&) {
        throw;
    } catch (const Error& none) {
        if (row.files.empty())
            throw;
        row.warnings.push_back(std::string(none.what()) + ".");
    }
}

} // namespace

void write_cloud_tiles(Work& work, const Outputs& outputs) {
    write_if_possible(work.row, [&] {
        if (!work.frame.cloud)
            throw Error(work.entry.name + ": no cloud, so no tiles");
        FramePoints all = points_of_cloud(work, outputs);
        const std::span<const Vector3d> points = all.points;
        Eigen::AlignedBox3d box;
        for (const Vector3d& point : points)
            if (point.allFinite())
                box.extend(point);
        TileAxes axes(work.frame.cloud->records.get(), box.center(), outputs, work.row);
        TilePoints shown(points, std::move(all), axes);
        shown.scene.earth_from_tiles = axes.earth_from_tiles();
        const fs::path folder = tiles_path(work.entry.name);
        report(write_tiles3d(outputs.files_folder() / folder, shown.scene), folder, work.row);
    });
}

struct LargeCloudTiles::Parts {
    Work& work;
    const Outputs& outputs;
    TileAxes axes;
    LargeTileset tileset;
};

LargeCloudTiles::LargeCloudTiles(Work& work, const Outputs& outputs) {
    const CloudStream& stream = work.large->file(work.large_file);
    const Vector3d middle = stream.box().value_or(Eigen::AlignedBox3d(Vector3d::Zero())).center();
    parts_.reset(new Parts{.work = work,
                           .outputs = outputs,
                           .axes = TileAxes(&stream.records(), middle, outputs, work.row),
                           .tileset = {outputs.files_folder() / tiles_path(work.entry.name), {}}});
}
LargeCloudTiles::~LargeCloudTiles() = default;

void LargeCloudTiles::add(std::span<const Vector3d> points, const std::vector<cv::Vec3b>& own,
                          const std::vector<float>& visibility, const std::vector<float>& error) {
    FramePoints some;
    some.visibility = visibility;
    some.confidence = confidence_of_points(error);
    const Outputs& outputs = parts_->outputs;
    some.colours = outputs.colour_cloud == CloudColours::kept ? own : cloud_colours(own, visibility, outputs);
    parts_->tileset.add(TilePoints(points, std::move(some), parts_->axes).scene);
}

void LargeCloudTiles::finish() {
    const fs::path folder = tiles_path(parts_->work.entry.name);
    FrameRow& row = parts_->work.row;
    write_if_possible(row, [&] { report(parts_->tileset.finish(parts_->axes.earth_from_tiles()), folder, row); });
}

} // namespace scanshade
