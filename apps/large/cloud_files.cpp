// Passes over files.
#include "apps/large/cloud_files.h"

#include "io/clouds/format.h"

#include <algorithm>

namespace scanshade {

using Eigen::Vector3d;

CloudFiles::CloudFiles(std::vector<CloudStream> files)
    : files_(std::move(files)), starts_{0}, told_(files_.size()),
      all_have_normals_(std::ranges::all_of(
          files_, [](const CloudStream& file) { return normal_fields(file.records()).has_value(); })) {
    for (const CloudStream& file : files_)
        starts_.push_back(starts_.back() + file.size());
}

void CloudFiles::pass(const Visit& visit) {
    for (std::size_t k = 0; k < files_.size(); ++k) {
        const auto fields = normal_fields(files_[k].records());
        Told told;
        double colour_step = 0;
        const std::size_t step = MapCounts::step(size());
        files_[k].pass([&](std::size_t first, const CloudRecords& block) {
            const std::vector<Vector3d> points = points_of(block, told.odd);
            const std::vector<Vector3d> normals =
                all_have_normals_ && (!passed_ || has_normals()) ? normals_of(block, *fields) : std::vector<Vector3d>();
            const std::size_t number = starts_[k] + first;
            if (!passed_) {
                normals_.add(points, normals);
                for (std::size_t i = (step - number % step) % step; i < points.size(); i += step)
                    map_.add(points[i]);
                colour_step = std::max(colour_step, colour_step_of(block));
                if (!told.coloured)
                    told.coloured = std::ranges::any_of(colours_of(block),
                                                        [](const cv::Vec3b& colour) { return colour != cv::Vec3b(); });
            }
            visit(number, points, normals);
        });
        if (!passed_) {
            told_[k] = told;
            files_[k].set_colour_step(colour_step);
        }
    }
    passed_ = true;
}

bool CloudFiles::has_normals() const { return all_have_normals_ && normals_.valid > 0 && normals_.are_normals(); }

bool CloudFiles::z_up() const { return files_.front().records().format->z_up || map_.on_a_map(); }

std::optional<Vector3d> CloudFiles::scanner() const {
    const CloudRecords& records = files_.front().records();
    return files_.size() == 1 && records.viewpoint ? std::optional<Vector3d>(records.viewpoint->translation())
                                                   : std::nullopt;
}

std::vector<std::string> CloudFiles::warnings(std::size_t file) const {
    std::vector<std::string> warnings;
    warn_of(told_[file].odd, files_[file].file(), warnings);
    return warnings;
}

} // namespace scanshade
