// Coordinates of a map as places on the Earth, by PROJ.
#pragma once

#include "io/rasters/crs.h"

#include <Eigen/Geometry>
#include <memory>
#include <span>
#include <string>

namespace scanshade::rasters {

/// From a coordinate system to EPSG:4978: metres from the Earth's centre, z towards the north pole. libproj is opened
/// when the first of these is made, since it would double the time that the program takes to start.
class Geocentric {
  public:
    /// Throws Error where libproj is missing, or does not know the system or a way from it to the Earth.
    explicit Geocentric(const Crs& crs);
    ~Geocentric();
    Geocentric(Geocentric&&) noexcept;
    Geocentric& operator=(Geocentric&&) = delete;

    /// In place, in order. What has no place becomes NaN. Not for several threads at once.
    void place(std::span<Eigen::Vector3d> points) const;
    /// "EPSG:32633", or the name of the system.
    [[nodiscard]] const std::string& system() const;
    /// A sentence on what was assumed about heights; empty where nothing was.
    [[nodiscard]] const std::string& heights() const;

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

/// The code in "EPSG:32633" as a system. Throws Error for other words.
[[nodiscard]] Crs crs_of_code(const std::string& words);

/// East, north and up at a place on WGS 84's ellipsoid, or above it: the columns, with the place as origin.
[[nodiscard]] Eigen::Isometry3d east_north_up(const Eigen::Vector3d& place);

} // namespace scanshade::rasters
