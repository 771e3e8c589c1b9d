// What `inspect` says of clouds that no single camera sees: density, classes, returns, unit and coordinate system.
#pragma once

#include "projection/frame.h"

#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace scanshade {

/// Sums and lists over several clouds.
class CloudFacts {
  public:
    /// A reference system that cannot be read becomes a warning.
    void add(const Cloud& cloud, const std::filesystem::path& file, std::vector<std::string>& warnings);

    [[nodiscard]] bool empty() const { return points_ == 0; }
    /// What a line is called, and its text.
    [[nodiscard]] std::vector<std::pair<std::string, std::string>> lines() const;
    [[nodiscard]] nlohmann::ordered_json to_json() const;

  private:
    void add_density(const std::vector<Eigen::Vector3d>& points, bool on_a_map);
    void add_reference(const std::string& header, const std::filesystem::path& file,
                       std::vector<std::string>& warnings);

    std::size_t points_ = 0;
    Eigen::AlignedBox3d extent_;
    std::vector<double> spacings_;                  ///< median distances, in the clouds' unit; one a cloud
    std::vector<double> densities_;                 ///< points a square unit of ground; one a cloud whose z is up
    std::map<int, std::size_t> classes_;            ///< points of each code
    std::map<int, std::size_t> returns_;            ///< points of each number
    std::set<std::string> units_;                   ///< with their source
    std::set<std::pair<int, std::string>> systems_; ///< EPSG (0 = no code) and name
};

} // namespace scanshade
