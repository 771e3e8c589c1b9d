// Captures with known truth: a synthetic scene seen by a simulated depth sensor, written in TUM's layout.
#pragma once

#include "apps/scenes/scanner.h"
#include "apps/scenes/world/light.h"
#include "projection/base/parameters.h"

#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace scanshade {

/// What to generate. The rows of parameters() point into this object: do not move it while they are used.
struct GenerateOptions {
    std::string scene = "office";  ///< a name of scenes() (apps/scenes/places/scenes.h)
    std::string sensor = "kinect"; ///< a name of sensors() (apps/scenes/sensor.h)
    int frames = 8;
    int first = 0, step = 1;            ///< frames first, first + step, ... of the scene's walk, ten per second
    std::string size = "640x480";       ///< width x height in pixels; the field of view stays that of a Kinect
    double lens_k1 = 0;                 ///< radial distortion of the lens before both images (Brown 1971)
    double depth_units = 0;             ///< stored per metre of depth; 0 = 5000, or floats where the scene needs them
    int seed = 1;                       ///< of the sensor's and the poses' noise and the truth's rays
    double pose_noise_m = 0;            ///< sigma of recorded positions along each axis
    double pose_noise_deg = 0;          ///< sigma of recorded rotations about each axis
    bool truth = true;                  ///< whether truth/depth, truth/normals and truth/ao are written
    double truth_radius_m = 0;          ///< occluders farther than this do not count; 0 = the scene's own
    int truth_rays = 256;               ///< per pixel
    std::string truth_falloff = "hard"; ///< any of hard,quad,lin
    scene::LightKind light = scene::LightKind::soft;
    std::string light_towards = "0.45,-0.35,0.82"; ///< a sun's, in the scene's world, z up
    double light_ratio = 1.5;                      ///< direct / ambient light
    bool light_occluded = true;                    ///< ambient light is multiplied by true visibility
    int cloud = 0;                                 ///< points; 0 = a recording
    bool cloud_normals = true;                     ///< whether the cloud has them
    int cloud_frames = 0;                          ///< so many frames of the sensor merged are the cloud; 0 = scanned
    bool cloud_shuffled = false;                   ///< whether merged frames' points lose their order
    scene::ScannerOptions scanner = {};            ///< of the cloud
    bool overwrite = false;

    /// Every setting but the scene, which is a word of the command line.
    [[nodiscard]] std::vector<Parameter> parameters();
};

/// From width x height such as "640x480", each 1 .. 8192. Throws Misuse naming the setting.
[[nodiscard]] cv::Size parsed_size(const std::string& text, std::string_view setting = "size");
/// A Kinect's 525 px at 640x480, the same field of view at other sizes.
[[nodiscard]] Pinhole camera_of_size(cv::Size size);

/// Called after each frame that is on disk, from the calling thread.
using GenerateProgress = std::function<void(int done, int total)>;

/// Writes to `out`:
/// - rgb/<stamp>.png, depth/<stamp>.png: depth_units per metre, or float .tiff in metres
/// - rgb.txt, depth.txt, groundtruth.txt (camera to world), camera.json, truth/truth.json
/// - truth/depth/<stamp>.tiff: exact z in metres; truth/normals/<stamp>.tiff: exact, x y z
/// - truth/ao/<stamp>.tiff: cosine-weighted visibility within truth_radius_m; ao_quad and ao_lin for those falloffs
/// - with a light whose parts are known: truth/ambient, truth/direct and truth/albedo/<stamp>.tiff, linear red, green,
///   blue; a colour image is then taken from where the depth image is, and is ambient * visibility + direct
/// - with `cloud` set, in place of images: NAME.ply, points of equal density on all that can be seen of the scene, or
///   what the scanner records, or merged depth frames; and truth/NAME.ply, the same with the field ambient_occlusion
/// Same options, same bytes, however many threads there are. A frame is the same whatever first and step lead to it.
/// Throws Misuse for options out of range, and for an `out` that holds something and is not to be overwritten. Also,
/// even then, for one that is no generated capture. Throws Error where a file cannot be written.
void generate(const GenerateOptions& options, const std::filesystem::path& out, const GenerateProgress& progress = {});

} // namespace scanshade
