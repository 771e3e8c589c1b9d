// The layouts of captures on disk, one function each; the table of recordings (recording_formats.h) has their order.
#pragma once

#include "io/captures/listing/capture_listing.h"

#include <cstddef>
#include <functional>
#include <initializer_list>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace scanshade {

class ZipArchive;

/// A capture as its layout lists it, before camera and depth encoding are settled.
struct Listing {
    Capture capture; ///< capture.depth is the layout's own encoding; an empty kind is that of its row in the table
    /// The layout's camera for depth images of this size (0x0 where no image could be read); may add to the warnings.
    /// Called only when the user named no camera.
    std::function<std::optional<CameraFile>(cv::Size depth_size, std::vector<std::string>& warnings)> find_camera;
    /// Gives entries their poses by time; none where the layout ties poses to frames itself. Called once the camera is
    /// known, because its file may have the offset between the clocks.
    std::function<void(Capture& capture, double pose_time_offset_s)> find_poses = {};
    /// Of a generic layout: names of files beside the images that the reader took something from. What else looks like
    /// poses or cameras there is named in a warning.
    std::vector<std::string> used = {};
    bool generic = false; ///< that it is one; from the table
    /// The poses are those of a robot's parts, which are known where it stands still, too.
    bool may_stand_still = false;
};

/// A folder that is no capture, with captures in it.
class SeveralCaptures : public Error {
  public:
    SeveralCaptures(const std::string& sentence, std::vector<std::filesystem::path> found)
        : Error(sentence), captures(std::move(found)) {}
    std::vector<std::filesystem::path> captures;
};

/// Whether the file begins as a recording does: a bag, MCAP, .sens, .mkv, .npz ...
[[nodiscard]] bool is_recording_file(const std::filesystem::path& file);

// Each returns nothing when the folder is not in its layout, and throws Error when it is but cannot be used.
[[nodiscard]] std::optional<Listing> list_tum(const std::filesystem::path& folder, const CaptureOptions& options);
[[nodiscard]] std::optional<Listing> list_nerfstudio(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_bop(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_polycam(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_stray_scanner(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_arkit_scenes(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_scannetpp(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_sun_rgbd(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_nyu_raw(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_replica(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_scannet(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_colmap(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_icl_nuim(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_webdataset(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_seven_scenes(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_kitti_odometry(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_nuscenes(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_hypersim(const std::filesystem::path& folder, const CaptureOptions& options);
[[nodiscard]] std::optional<Listing> list_pcl_recording(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_redwood(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_viewer_snapshots(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_image_folders(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_depth_images(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Listing> list_clouds(const std::filesystem::path& folder);

// Files that hold a recording: whether one begins so, and what it holds. list_...() throws Error where it cannot be
// used.
[[nodiscard]] bool is_sens(std::string_view start);
[[nodiscard]] Listing list_sens(const std::filesystem::path& file);
/// Bags of ROS 1 and 2, MCAP, RealSense's recordings; is_bag() tells them (io/captures/recordings/ros/bag.h).
[[nodiscard]] Listing list_ros(const std::filesystem::path& file, const CaptureOptions& options);
[[nodiscard]] Listing list_ros(const std::filesystem::path& path, const std::vector<std::filesystem::path>& files,
                               const CaptureOptions& options);
[[nodiscard]] std::optional<Listing> list_rosbag2_folder(const std::filesystem::path& folder,
                                                         const CaptureOptions& options);
/// Matroska with a depth track; matroska::is_matroska() tells it. Throws NoFrames for ordinary videos.
[[nodiscard]] Listing list_azure_kinect(const std::filesystem::path& file);
/// NYU depth v2's labelled images, a .mat of version 7.3. Throws NoFrames for other ones.
[[nodiscard]] bool is_matlab_hdf5(std::string_view start);
[[nodiscard]] Listing list_nyu_labelled(const std::filesystem::path& file);
/// (N,H,W) in an .npy file.
[[nodiscard]] bool is_npy_stack(std::string_view start);
[[nodiscard]] Listing list_npy_stack(const std::filesystem::path& file);
/// NumPy's .npz, Record3D's .r3d: by the members. Throws NoFrames for other archives.
[[nodiscard]] Listing list_zip(const std::filesystem::path& file);
[[nodiscard]] Listing list_npz(const std::shared_ptr<const ZipArchive>& archive);
[[nodiscard]] Listing list_record3d(const std::shared_ptr<const ZipArchive>& archive);

// --- what layouts share ---

/// Files of one folder. Their paths are made when they are asked for: a million would take half a gigabyte.
class FolderFiles {
  public:
    FolderFiles() = default;
    FolderFiles(std::filesystem::path folder, std::vector<std::string> names)
        : folder_(std::move(folder)), names_(std::move(names)) {}
    [[nodiscard]] std::size_t size() const { return names_.size(); }
    [[nodiscard]] bool empty() const { return names_.empty(); }
    [[nodiscard]] std::filesystem::path operator[](std::size_t index) const { return folder_ / names_[index]; }
    [[nodiscard]] std::filesystem::path front() const { return (*this)[0]; }
    /// Leaves out those for whose path this is false.
    template <class Wanted>
    [[nodiscard]] FolderFiles only(const Wanted& wanted) && {
        std::erase_if(names_, [&](const std::string& name) { return !wanted(folder_ / name); });
        return std::move(*this);
    }

    class Iterator {
      public:
        using value_type = std::filesystem::path;
        using difference_type = std::ptrdiff_t;
        Iterator() = default;
        Iterator(const FolderFiles& files, std::size_t index) : files_(&files), index_(index) {}
        std::filesystem::path operator*() const { return (*files_)[index_]; }
        Iterator& operator++() { return ++index_, *this; }
        Iterator operator++(int) { return {*files_, index_++}; }
        bool operator==(const Iterator& other) const { return index_ == other.index_; }

      private:
        const FolderFiles* files_ = nullptr;
        std::size_t index_ = 0;
    };
    [[nodiscard]] Iterator begin() const { return {*this, 0}; }
    [[nodiscard]] Iterator end() const { return {*this, size()}; }

  private:
    std::filesystem::path folder_;
    std::vector<std::string> names_;
};
/// The folder's own files, hidden and foreign ones (._*, Thumbs.db) left out, in natural order: 2 before 10.
[[nodiscard]] FolderFiles files_in(const std::filesystem::path& folder);
[[nodiscard]] bool natural_less(const std::string& a, const std::string& b);

/// The child folder of the first of these names that is there.
[[nodiscard]] std::optional<std::filesystem::path> folder_named(const std::filesystem::path& parent,
                                                                std::initializer_list<std::string_view> names);
/// A folder's depth, or colour, images in natural order; none of no folder.
[[nodiscard]] FolderFiles depth_images_in(const std::optional<std::filesystem::path>& folder);
[[nodiscard]] FolderFiles colour_images_in(const std::optional<std::filesystem::path>& folder);
/// The same by their names without the extension.
class ImagesByStem {
  public:
    explicit ImagesByStem(const FolderFiles& images);
    [[nodiscard]] bool empty() const { return paths_.empty(); }
    /// Empty where there is none.
    [[nodiscard]] StoredPath of(const std::string& stem) const;

  private:
    std::unordered_map<std::string, StoredPath> paths_;
};
/// A file's JSON. Throws Error naming file and place.
[[nodiscard]] nlohmann::json json_in(const std::filesystem::path& file);
/// The same of a text; `file` stands for the file in messages.
[[nodiscard]] nlohmann::json parsed_json(const std::string& text, const std::filesystem::path& file);
/// An image's size by its header; 0x0 where that cannot be read: loading it will say why.
[[nodiscard]] cv::Size peek_size(const std::filesystem::path& image);
/// Sides as a file gives them. Throws Error, beginning with `where`, for what is no image's size.
[[nodiscard]] cv::Size image_size(double width, double height, const std::string& where);
/// An entry's own camera for its depth image: `camera` is for images of `size`, which see the same in other pixels.
[[nodiscard]] std::shared_ptr<const Camera> camera_for_depth(Camera camera, cv::Size size, cv::Size depth);

/// Phones make their depth on the colour camera's pixels, in fewer of them, mostly in millimetres.
[[nodiscard]] Listing listing_of_phone(const std::string& layout);

/// For entries with cameras of their own: the first stands for the capture. Depth of another size than the first's is a
/// problem, since a recorder makes one size.
void settle_own_cameras(Listing& listing);

/// One warning that names those of a layout's parts that are there and are not used, such as masks.
void tell_ignored(const std::filesystem::path& folder, std::initializer_list<std::string_view> names,
                  std::vector<std::string>& warnings);

/// Why a listed file cannot be opened: it is missing, or its name leads out of the capture's folder. Links are
/// followed. Empty = it can be opened.
[[nodiscard]] std::string trouble_with(const std::filesystem::path& folder, const std::string& name);

/// The camera among a folder's files: camera.json, any JSON or text file whose name speaks of a camera or intrinsics,
/// info.txt or _info.txt. A file that speaks of a camera and cannot be read is an Error; of several, the first is used
/// and the others are named.
[[nodiscard]] std::optional<CameraFile> camera_in(const std::filesystem::path& folder,
                                                  std::vector<std::string>& warnings);

/// The camera and depth unit in the XML file that PCL writes with a depth image of its recordings (TIME.xml for
/// TIME_depth.pclzf); nothing where there is none.
[[nodiscard]] std::optional<CameraFile> camera_beside_pclzf(const std::filesystem::path& depth);

/// What recordings of a layout usually have, though nothing in them says so.
[[nodiscard]] DepthEncoding usual_encoding(const std::string& text, const std::string& origin);
/// "assumed: 16-bit integers are millimetres", or metres where `first_depth` holds floats.
[[nodiscard]] DepthEncoding assumed_encoding(const std::filesystem::path& first_depth);

/// Makes the entries' names unique, and fit for file names: UTF-8 without slashes and control characters, not hidden,
/// and short enough to be extended.
void settle_names(std::vector<CaptureEntry>& entries);

} // namespace scanshade
