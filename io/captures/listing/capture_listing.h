// A recording, listed: what its frames are and where, nothing decoded yet.
#pragma once

#include "io/cameras/camera_file.h"
#include "io/captures/listing/container.h"
#include "io/captures/listing/stored_path.h"
#include "io/images/image_file.h"
#include "projection/base/error.h"
#include "projection/frame.h"
#include "projection/length_unit.h"
#include "projection/motion.h"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// Of a capture in an arbitrary unit. The usual radius of 0.5 is then a tenth of the median depth.
constexpr double usual_median_depth = 5;

/// Settings of the user for facts that a capture's files may lack.
struct CaptureOptions {
    std::string camera;                ///< file or "fx,fy,cx,cy"; empty = from the capture
    std::string depth_scale;           ///< as depth_encoding() takes it; empty = from the layout
    double association_limit_s = 0.02; ///< colour, depth and poses farther apart in time are not paired (TUM)
    std::filesystem::path poses =
        {}; ///< TUM's rows, by time or, where frames have none, by index; empty = the capture's own
    std::filesystem::path colour = {}; ///< the colour image of a single depth image, registered to it; empty = none
    std::string topic = {};            ///< of depth images in a recording of ROS; empty = found by name and type
    double median_depth = usual_median_depth; ///< of a capture in an arbitrary unit: in the walk's lengths
    int confidence_min = 1; ///< depth whose confidence is lower is a hole: 0 low, 1 medium, 2 high, as phones give it
    bool copc = true;       ///< false: COPC is read as LAZ is; else one whose octree is damaged is refused
};

/// One frame's listing: the paths of its parts. Nothing is decoded yet.
struct CaptureEntry {
    std::string name;                ///< unique in the capture
    StoredPath colour, depth, cloud; ///< empty where there is none
    /// Where the images are in one file with those of other frames: `colour`, `depth` and `confidence` name that file,
    /// and stay empty for images that the frame lacks.
    std::shared_ptr<const FrameContainer> container;
    std::size_t place = 0; ///< in the container
    Rare<Eigen::Isometry3d> world_from_camera;
    std::optional<double> stamp_s;        ///< of the depth image
    std::optional<double> colour_stamp_s; ///< of the colour image paired with it
    Rare<Motion> motion;                  ///< of the camera at that time, if the trajectory has it
    std::shared_ptr<const Camera> camera; ///< its own; null = the capture's
    double depth_units_per_metre = 0;     ///< its own; 0 = the capture's
    StoredPath confidence;                ///< an image of depth's size, 0 where depth is not to be believed
    std::string problem; ///< why this frame cannot be loaded (names file and line); empty = it may be tried
    std::vector<std::string> warnings; ///< oddities in the listing of this frame
};

/// A depth, and how many pixels or points have it.
struct DepthLevel {
    float z_m = 0;
    std::uint32_t count = 0;
};

/// A frame without the places of its depths where these are integers: they take at most 65536 values, so that counts
/// need far less memory than an image in metres.
struct ExaminedFrame {
    Frame frame;                    ///< as load() gives it, but depth_m is empty where `levels` has the depths
    cv::Size depth_size;            ///< of the depth image; 0x0 for a cloud
    std::vector<DepthLevel> levels; ///< rising, without holes
};

/// A folder has no known layout. Its own folders may.
class NoFrames : public Error {
  public:
    using Error::Error;
};

/// A recording, listed. Opening is cheap; frames are decoded by load().
struct Capture {
    std::filesystem::path path;
    std::string kind;             ///< the format's name in the table (formats.h): "TUM RGB-D", "BOP", "depth image" ...
    std::optional<Camera> camera; ///< none: clouds recover theirs; depth images need --camera
    DepthEncoding depth;
    LengthUnit unit;         ///< arbitrary: depths and poses are no metres but parts of the scene, see settle_unit()
    int confidence_min = 1;  ///< CaptureOptions::confidence_min
    bool copc = true;        ///< CaptureOptions::copc
    double median_depth = 0; ///< of such a capture, in the walk's lengths; 0 = no depth was readable
    DepthCorrection depth_correction;          ///< from the camera's file; load() applies it
    std::optional<ColourCamera> colour_camera; ///< the secondary camera, if one took the colour images and is known
    double pose_time_offset_s = 0;             ///< from the camera's file; already in the poses
    Registration registration = Registration::unknown;
    std::string registration_reason;
    bool colour_in_more_pixels = false; ///< registered colour sees what depth sees, finer: load() reduces it
    std::string confidence_levels;      ///< of confidence images, the lowest a hole: "0 low, 1 medium, 2 high"
    double guessed_beyond_m = 0;        ///< the recorder made up most depths beyond; 0 = none
    std::vector<CaptureEntry> entries;  ///< in recording order
    std::vector<std::string> warnings;  ///< about the capture as a whole

    /// Decodes frame `index`; safe to call from several threads. Throws Error naming file and place, Outage where the
    /// capture cannot be reached any more; a damaged colour image is a warning, not a failure. Without colour, whose
    /// decoding takes as long as the depth's, it is not looked at.
    [[nodiscard]] Frame load(std::size_t index, bool with_colour = true) const;
    /// The same for a look at it: less memory, and faster.
    [[nodiscard]] ExaminedFrame examine(std::size_t index) const;
};

} // namespace scanshade
