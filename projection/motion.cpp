// Differences of poses, and interpolation.
#include "projection/motion.h"

namespace scanshade {

Motion motion_between(const Eigen::Isometry3d& before, const Eigen::Isometry3d& after, double seconds,
                      const Eigen::Isometry3d& at) {
    const Eigen::AngleAxisd rotation((before.linear().transpose() * after.linear()).eval());
    const Eigen::Vector3d translation_in_world = after.translation() - before.translation();
    return {rotation.angle() * rotation.axis() / seconds, at.linear().transpose() * translation_in_world / seconds};
}

Eigen::Isometry3d pose_between(const Eigen::Isometry3d& before, const Eigen::Isometry3d& after, double share) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() =
        Eigen::Quaterniond(before.linear()).slerp(share, Eigen::Quaterniond(after.linear())).toRotationMatrix();
    pose.translation() = (1 - share) * before.translation() + share * after.translation();
    return pose;
}

} // namespace scanshade
