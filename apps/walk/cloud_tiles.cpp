#include "apps/walk/cloud_tiles.h"

#include "apps/frame/frame_points.h"
#include "apps/picture.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/tiles3d.h"
#include "io/rasters/geocentric.h"
#include "io/rasters/las_crs.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

rasters::Crs crs_of(const Cloud& cloud, const Outputs& outputs) {
    if (!outputs.tiles_crs.empty())
        return rasters::crs_of_code(outputs.tiles_crs);
    if (cloud.records && cloud.records->header.starts_with("LASF"))
        return rasters::crs_of_las(cloud.records->header);
    return {};
}

/// Points in axes whose origin is amid them, east, north and up.
struct Placed {
    std::vector<Vector3d> points;
    Eigen::Isometry3d earth_from_points;
};
std::optional<Placed> placed_on_earth(const Cloud& cloud, const Outputs& outputs, FrameRow& row) {
    const auto stay_local = [&](const std::string& why) {
        row.warnings.push_back(fmt::format("{}: tiles are local, a globe shows them at the Earth's centre; "
                                           "--tiles-crs EPSG:n names the coordinates' system.",
                                           why));
        return std::nullopt;
    };
    try {
        const rasters::Crs crs = crs_of(cloud, outputs);
        if (!crs.known)
            return stay_local("the cloud has no coordinate system");
        const rasters::Geocentric earth(crs);
        Placed placed{cloud.points, {}};
        earth.place(placed.points);
        Eigen::AlignedBox3d box;
        std::size_t lost = 0;
        for (std::size_t i = 0; i < placed.points.size(); ++i) {
            box.extend(placed.points[i].allFinite() ? Eigen::AlignedBox3d(placed.points[i]) : Eigen::AlignedBox3d());
            lost += cloud.points[i].allFinite() && !placed.points[i].allFinite();
        }
        if (box.isEmpty())
            return stay_local(fmt::format("no point has a place in {}", earth.system()));
        if (lost > 0)
            row.warnings.push_back(
                fmt::format("{} without a place in {}, left out of tiles.", counted(lost, "point"), earth.system()));
        placed.earth_from_points = rasters::east_north_up(box.center());
        const Eigen::Isometry3d points_from_earth = placed.earth_from_points.inverse();
        for (Vector3d& point : placed.points)
            point = points_from_earth * point;
        row.notes.push_back(fmt::format("tiles are on the Earth by {}.", earth.system()));
        if (!earth.heights().empty())
            row.notes.push_back(earth.heights());
        return placed;
    } catch (const Outage&) {
        throw;
    } catch (const Error& none) {
        return stay_local(none.what());
    }
}

} // namespace

void write_cloud_tiles(Work& work, const Outputs& outputs) {
    try {
        if (!work.frame.cloud)
            throw Error(work.entry.name + ": no cloud, so no tiles");
        FramePoints all = points_of_cloud(work, outputs);
        const std::optional<Placed> placed = placed_on_earth(*work.frame.cloud, outputs, work.row);
        if (all.colours.empty())
            all.colours = greys(all.visibility);
        for (std::size_t i = 0; i < all.visibility.size(); ++i)
            if (std::isnan(all.visibility[i])) { // formats of tiles have no NaN
                all.visibility[i] = 1;
                if (!all.confidence.empty())
                    all.confidence[i] = 0;
            }
        TilesetScene scene{.name = work.entry.name,
                           .points = all.points,
                           .colours = all.colours,
                           .fields = {{"_AMBIENT_OCCLUSION", all.visibility}},
                           .earth_from_tiles = {}};
        if (!all.confidence.empty())
            scene.fields.push_back({"_AO_CONFIDENCE", all.confidence});
        if (placed) {
            scene.points = placed->points;
            scene.earth_from_tiles = placed->earth_from_points;
        }
        const fs::path folder = tiles_path(work.entry.name);
        const TilesWritten written = write_tiles3d(outputs.files_folder() / folder, scene);
        for (const fs::path& file : written.files)
            work.row.files.push_back(folder / file);
        work.row.notes.push_back(fmt::format("{}: {} in {}, {}.", folder.generic_string(),
                                             counted(written.points, "point"), counted(written.tiles, "tile"),
                                             counted(static_cast<std::size_t>(written.levels), "level")));
    } catch (const Outage&) {
        throw;
    } catch (const Error& none) {
        if (work.row.files.empty())
            throw;
        work.row.warnings.push_back(std::string(none.what()) + ".");
    }
}

} // namespace scanshade
