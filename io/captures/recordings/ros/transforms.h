// The tree of frames that /tf and /tf_static describe.
#pragma once

#include "io/captures/listing/trajectory.h"
#include "io/captures/recordings/ros/messages.h"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace scanshade::ros {

class Transforms {
  public:
    void add(const Transform& transform, bool fixed);
    /// Sorts by time; call it after the last add().
    void settle();

    /// The pose of `frame` in the world at that time: the product of its links up to "world", "map" or "odom", or to
    /// the top where a link moves. Moving links are interpolated between neighbours at most 0.1 s away. Nothing where
    /// there is no such chain.
    [[nodiscard]] std::optional<Eigen::Isometry3d> world_from(const std::string& frame, double stamp_s) const;
    /// Where both frames hang on the same tree by fixed links.
    [[nodiscard]] std::optional<Eigen::Isometry3d> between(const std::string& to, const std::string& from) const;
    /// Whether a frame, or a fixed link above it, is turned from a body's axes (x forward, z up) to a camera's (REP
    /// 103).
    [[nodiscard]] bool optical(const std::string& frame) const;
    [[nodiscard]] bool empty() const { return links_.empty(); }

  private:
    struct Link {
        std::string parent;
        bool fixed = false;
        std::vector<StampedPose> poses; ///< parent_from_child
    };
    [[nodiscard]] const Link* above(const std::string& frame) const;
    /// The frame itself and those above it, at most 64.
    [[nodiscard]] std::vector<std::string> chain(const std::string& frame) const;

    std::map<std::string, Link> links_; ///< by the child
};

} // namespace scanshade::ros
