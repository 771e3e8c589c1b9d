// A run as one recording for Foxglove, Rerun and ROS: run.mcap, which frames join in recording order.
#pragma once

#include "io/captures/capture.h"
#include "io/captures/recordings/ros/mcap_output.h"

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace scanshade {

/// The topics. Images are those of one camera, whose numbers are in camera_info.
enum class McapTopic : std::uint16_t {
    frame = 1, ///< std_msgs/String: the frame's name and numbers, as JSON
    tf,
    tf_static,
    camera_info,
    depth,      ///< Image: 16UC1 or 32FC1
    colour,     ///< CompressedImage, as are the next three: PNG
    ao,         ///< visibility, as in out/ao/
    confidence, ///< as in out/confidence/
    shaded,     ///< as in out/shaded/
    points      ///< PointCloud2
};

/// Writes the file frame by frame; what it will have are groups of messages, one for each frame. Until finish() it has
/// a name of its own in the folder, .run.N.mcap.part. A run that is killed leaves it there, and a resumed run takes its
/// frames. All calls but stamp_ns() come from one thread at a time.
class McapRecording {
  public:
    /// `resume`: frames of earlier files are looked up; else these files are removed.
    McapRecording(std::filesystem::path file, const Capture& capture, bool resume);

    /// Whether an earlier file has the frame whole.
    [[nodiscard]] bool has(const std::string& frame) const { return earlier_.contains(frame); }
    /// All frames in their order; those in `kept` come from earlier files.
    void begin(const std::vector<std::size_t>& frames, std::set<std::size_t> kept);
    /// Frames come in that order. Kept ones before this one are copied first.
    void add(std::size_t index, const std::string& group);
    /// Copies the kept frames that are left, gives the file its name, and removes earlier parts.
    void finish();

    /// When the frame was recorded: its own stamp, or one of 30 in a second where not every frame of the capture has
    /// one that ROS can hold.
    [[nodiscard]] std::int64_t stamp_ns(std::size_t index) const;
    [[nodiscard]] bool has_own_stamps() const { return own_stamps_; }
    /// Whether any frame of the capture has a pose.
    [[nodiscard]] bool has_poses() const { return has_poses_; }
    /// Whether depth images are whole millimetres, as 16 bits hold them.
    [[nodiscard]] bool in_millimetres() const { return in_millimetres_; }

    [[nodiscard]] const std::filesystem::path& path() const { return file_; }
    /// "40 frames, 391 messages, 123.4 MB", once it is finished.
    [[nodiscard]] const std::string& summary() const { return summary_; }

  private:
    struct Place {
        std::shared_ptr<const std::filesystem::path> file;
        ros::GroupPlace group;
    };
    [[nodiscard]] std::map<unsigned, std::filesystem::path> parts() const;
    void append(const std::string& group);
    void copy_until(std::size_t index);

    std::filesystem::path file_, part_;
    const Capture& capture_;
    bool own_stamps_ = false, has_poses_ = false, in_millimetres_ = false;
    std::map<std::string, Place> earlier_; ///< by the frame's name
    std::vector<std::size_t> frames_;
    std::set<std::size_t> kept_;
    std::size_t next_ = 0; ///< of frames_
    std::size_t added_ = 0;
    std::unique_ptr<ros::McapOutput> output_;
    std::string summary_;
};

/// "run.mcap", or "run.0-500.mcap" of a block of a capture's frames.
[[nodiscard]] std::filesystem::path mcap_file(const std::filesystem::path& folder, const std::string& block);

} // namespace scanshade
