// Whether the stations that a file of several scans records can be where its points were seen from.
#pragma once

#include "ao/base/method.h"

#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// What the stations of a file are good for.
struct RecordedStations {
    std::vector<Eigen::Vector3d> seen_from; ///< the station of every point; empty where they cannot be right
    std::string note;                       ///< a sentence for people: how they were judged
    bool contradict = false;                ///< they are places, and do not see the points
    double opposed = 0;   ///< of the recorded normals of points that their station sees: the share that faces away
    double agreement = 1; ///< of recorded normals with planes: CloudSurface::agreement
};

/// Between a point and its station was nothing when it was recorded. So stations are believed if most points of a
/// sample, and many of each scan, are seen from theirs past the discs of all others. Scans that all name one place, as
/// files do that know none, are not. `normals` is empty or holds one per point.
[[nodiscard]] RecordedStations recorded_stations(std::span<const Station> stations,
                                                 std::span<const Eigen::Vector3d> points,
                                                 std::span<const Eigen::Vector3d> normals);

} // namespace scanshade
