#include "io/captures/recordings/ros/transforms.h"

#include <algorithm>
#include <array>

namespace scanshade::ros {

void Transforms::add(const Transform& transform, bool fixed) {
    Link& link = links_[transform.child];
    if (link.parent != transform.parent) { // a new parent replaces the old one
        link.parent = transform.parent;
        link.poses.clear();
    }
    link.fixed = fixed;
    if (fixed)
        link.poses.clear();
    link.poses.push_back({static_cast<double>(transform.stamp_ns) * 1e-9, transform.parent_from_child});
}

void Transforms::settle() {
    for (auto& [child, link] : links_)
        std::ranges::stable_sort(link.poses, {}, &StampedPose::stamp_s);
}

const Transforms::Link* Transforms::above(const std::string& frame) const {
    const auto found = links_.find(frame);
    return found == links_.end() ? nullptr : &found->second;
}

std::vector<std::string> Transforms::chain(const std::string& frame) const {
    constexpr std::size_t deepest = 64; // a damaged recording may go round in circles
    std::vector<std::string> frames{frame};
    for (const Link* link = above(frame); link && frames.size() < deepest; link = above(link->parent))
        frames.push_back(link->parent);
    return frames;
}

std::optional<Eigen::Isometry3d> Transforms::world_from(const std::string& frame, double stamp_s) const {
    const std::vector<std::string> frames = chain(frame);
    auto root = frames.end();
    for (const char* name : {"world", "map", "odom"})
        if (root == frames.end())
            root = std::ranges::find(frames, name);
    const bool named = root != frames.end();
    if (!named)
        root = frames.end() - 1;
    constexpr double apart_s = 0.1;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    bool moves = false;
    for (auto at = frames.begin(); at != root; ++at) {
        const Link& link = *above(*at);
        const auto step =
            link.fixed ? std::optional(link.poses.back().world_from_camera) : pose_at(link.poses, stamp_s, apart_s);
        if (!step)
            return std::nullopt;
        moves = moves || !link.fixed;
        pose = *step * pose;
    }
    if (root == frames.begin() || (!named && !moves))
        return std::nullopt;
    return pose;
}

std::optional<Eigen::Isometry3d> Transforms::between(const std::string& to, const std::string& from) const {
    if (to == from)
        return Eigen::Isometry3d::Identity();
    const std::vector<std::string> up_to = chain(to), up_from = chain(from);
    const auto climbed = [&](const std::vector<std::string>& frames,
                             const std::string& top) -> std::optional<Eigen::Isometry3d> {
        Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
        for (const std::string& frame : frames) {
            if (frame == top)
                return pose;
            const Link* link = above(frame);
            if (!link || !link->fixed)
                return std::nullopt;
            pose = link->poses.back().world_from_camera * pose;
        }
        return std::nullopt;
    };
    for (const std::string& top : up_from) {
        if (std::ranges::find(up_to, top) == up_to.end())
            continue;
        const auto top_from = climbed(up_from, top), top_to = climbed(up_to, top);
        if (top_from && top_to)
            return top_to->inverse() * *top_from;
        return std::nullopt;
    }
    return std::nullopt;
}

bool Transforms::optical(const std::string& frame) const {
    if (frame.find("optical") != std::string::npos)
        return true;
    // Columns: the camera's x, y and z in a body's axes.
    const Eigen::Matrix3d turn{{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}};
    return std::ranges::any_of(chain(frame), [&](const std::string& each) {
        const Link* link = above(each);
        return link && link->fixed && (link->poses.back().world_from_camera.linear() - turn).norm() < 0.2;
    });
}

} // namespace scanshade::ros
