// Which files a run writes for each frame, and where.
#pragma once

#include "ao/finish/finish.h"
#include "io/captures/capture.h"
#include "io/images/image_file.h"

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// What becomes of a cloud's colours: they stay; they are multiplied by visibility; or so, and clouds without colours
/// of their own get visibility as grey.
enum class CloudColours { kept, shaded, grey };

/// The folders that Outputs fill.
inline constexpr std::array result_folders = {"ao",       "confidence", "error",    "shaded", "unshaded",
                                              "ambient",  "direct",     "indirect", "panel",  "clouds",
                                              "previews", "points",     "meshes",   "tiles"};
inline constexpr const char* texture_folder = "meshes";
/// That of tars of results (result_tars.h).
inline constexpr const char* tar_folder = "tars";

/// Textures of a mesh's occlusion, in meshes/.
struct TextureOutput {
    bool wanted = false;
    int size = 1024;      ///< texels, of each side
    int margin = -1;      ///< texels; negative = size / 128
    int rays = 0;         ///< of each texel; 0 = as TextureAoOptions
    int seed = 0;         ///< of these
    bool replace = false; ///< an occlusionTexture of a glTF
};

/// The files written for each frame, under `folder`: ao/NAME.png, confidence/NAME.png, error/NAME.png, shaded/NAME.png,
/// panel/NAME.png, clouds/NAME.pcd or .ply; for the page previews/NAME.js, or points/NAME.000.js and on of a cloud
/// computed from its points.
struct Outputs {
    std::filesystem::path folder;
    LengthUnit unit = {};   ///< of the capture: lengths are written in it
    bool ao = true;         ///< the visibility map
    bool confidence = true; ///< how reliable the visibility is (confidence_from()), as 8 bits or floats
    bool error = false;     ///< the expected error of the visibility; of clouds the field ao_error
    bool shaded = true; ///< colour times visibility; clay times visibility where colour is not known to fit the depth
    bool unshaded = false; ///< colour divided by visibility, where there is colour
    bool light = false;    ///< colour's ambient and direct part, where there is colour
    bool indirect = false; ///< one bounce: colour that comes from neighbours, where there is colour
    bool panel = false;    ///< colour | depth | AO | shaded
    bool cloud = true; ///< a cloud input with the fields ambient_occlusion and ao_confidence, everything else as it was
    bool depth_cloud = false; ///< a new PLY of a depth frame's points, in camera space
    bool glb = false;         ///< the points of either as binary glTF
    TextureOutput texture = {};
    bool tiles3d = false;       ///< a cloud's points as 3D Tiles, in tiles/NAME/
    std::string tiles_crs = {}; ///< of their coordinates, as "EPSG:25832"; empty = as the file says
    bool mcap = false;          ///< all frames as one recording, run.mcap; not a file of a frame
    AoFormat format = AoFormat::png16;
    /// Of unshaded, ambient, direct and indirect; none: PNG with as many bits as the colour image has.
    std::optional<AoFormat> colour_format = {};
    Shade shade = Shade::multiply; ///< what visibility multiplies in pictures
    double shade_strength = 1;     ///< 0 leaves the colour, 1 multiplies by visibility
    bool colour_view = false;      ///< maps and pictures of frames with a secondary camera use its pixels
    CloudColours colour_cloud = CloudColours::kept;
    bool preview = false;              ///< what the page shows of the frame beside the other files
    std::size_t page_points = 1000000; ///< of a cloud, at most, on the page
    std::size_t frames_in_tar = 0;     ///< 0 = single files; else they go into tars of so many frames
    std::filesystem::path waiting;     ///< where files for a tar wait until it takes them; empty = none do

    /// Where the walk writes a frame's files.
    [[nodiscard]] const std::filesystem::path& files_folder() const { return waiting.empty() ? folder : waiting; }
};

/// A frame's files, relative to the folder. `kind` is "shaded" or "panel"; a cloud's points for the page have parts.
[[nodiscard]] std::filesystem::path ao_file(const std::string& name, const Outputs& outputs);
[[nodiscard]] std::filesystem::path confidence_file(const std::string& name, const Outputs& outputs);
[[nodiscard]] std::filesystem::path error_file(const std::string& name, const Outputs& outputs);
[[nodiscard]] std::filesystem::path picture_file(const char* kind, const std::string& name);
/// Of "unshaded", "ambient", "direct" or "indirect".
[[nodiscard]] std::filesystem::path light_file(const char* kind, const std::string& name, const Outputs& outputs);
[[nodiscard]] std::filesystem::path cloud_file(const std::string& name, const std::string& extension);
/// Of a cloud whose format has no room for fields, beside cloud_file().
[[nodiscard]] std::filesystem::path fields_file(const std::string& name);
/// The folder of a cloud's 3D Tiles.
[[nodiscard]] std::filesystem::path tiles_path(const std::string& name);
[[nodiscard]] std::filesystem::path preview_file(const std::string& name);
[[nodiscard]] std::filesystem::path points_file(const std::string& name, std::size_t part);

/// What is written of a cloud computed from its points, which has no pixels: maps of visibility and confidence are its
/// fields, so each of them asks for the cloud.
[[nodiscard]] Outputs of_points(const Outputs& outputs);

/// The files that `outputs` makes of a frame. A cloud has both possible names, since only its content has the format.
[[nodiscard]] std::vector<std::filesystem::path> files_of(const CaptureEntry& entry, const Outputs& outputs);

/// What the numbers in unshaded, ambient, direct and indirect mean; empty where none of them is written.
[[nodiscard]] std::string colour_encoding(const Outputs& outputs);

/// Whether the light of the colour images matters.
[[nodiscard]] inline bool needs_light(const Outputs& outputs) {
    return outputs.light || (outputs.shade == Shade::ambient && (outputs.shaded || outputs.unshaded || outputs.panel));
}

/// Whether any output shows the colour images.
[[nodiscard]] inline bool shows_colour(const Outputs& outputs, bool recording_cloud) {
    return outputs.shaded || outputs.unshaded || outputs.light || outputs.indirect || outputs.panel ||
           outputs.depth_cloud || outputs.glb || outputs.colour_view || recording_cloud;
}

} // namespace scanshade
