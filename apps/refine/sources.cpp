// Refines from pictures and clouds, with notes about what was left out; and finds first cameras.
#include "apps/refine/sources.h"

#include "io/cameras/camera_file.h"
#include "io/captures/listing/layouts.h"
#include "io/images/exif.h"
#include "io/images/format.h"
#include "io/images/image_file.h"
#include "projection/base/error.h"
#include "projection/calibration/boards/organised_clouds.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace fs = std::filesystem;
using namespace calibration;
namespace {

Camera with_lens(Camera camera, LensModel lens) {
    if (lens == LensModel::kannala_brandt && camera.distortion.model != lens)
        camera.distortion = {.model = lens};
    return camera;
}

Pinhole centred(double focal_length, cv::Size size) {
    return {focal_length, focal_length, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size};
}

struct Picture {
    std::string name;
    cv::Mat3b pixels;
};

/// The readable pictures of a folder, all of the most common size. Each other picture gets a note.
std::vector<Picture> pictures_in(const fs::path& folder, std::vector<std::string>& notes) {
    std::vector<Picture> all;
    std::map<std::pair<int, int>, int> sizes;
    for (const fs::path& file : files_in(folder)) {
        if (!has_colour_extension(file))
            continue;
        try {
            all.push_back({file.filename().string(), read_colour(file)});
            ++sizes[{all.back().pixels.cols, all.back().pixels.rows}];
        } catch (const std::exception& failure) {
            notes.push_back(fmt::format("{}; not used.", failure.what()));
        }
    }
    if (all.empty())
        throw Error(folder.string() + ": no pictures (PNG, JPEG ...) of a board that can be read");
    const auto most_common = std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) {
                                 return a.second < b.second;
                             })->first;
    std::erase_if(all, [&](const Picture& picture) {
        if (std::pair(picture.pixels.cols, picture.pixels.rows) == most_common)
            return false;
        notes.push_back(fmt::format("{}: {}x{} among pictures of {}x{}: all must have one size; not used.",
                                    (folder / picture.name).string(), picture.pixels.cols, picture.pixels.rows,
                                    most_common.first, most_common.second));
        return true;
    });
    return all;
}

/// From the boards' homographies, or where those fail, from the pictures' EXIF.
Camera first_guess(const std::vector<BoardView>& views, const fs::path& picture, LensModel lens, cv::Size size) {
    try {
        return with_lens(guess_from_boards(views, size), lens);
    } catch (const Error&) {
        if (!exif_focal_length_px(picture, size))
            throw;
        return guessed_camera(picture, lens, size);
    }
}

std::string text_of(const Target& target) {
    const char* kinds[] = {"chessboard of {}x{} corners", "ChArUco board of {}x{} squares", "grid of {}x{} circles",
                           "asymmetric grid of {}x{} circles"};
    return fmt::format(fmt::runtime(std::string(kinds[static_cast<int>(target.kind)]) + ", {:g} mm"),
                       target.count.width, target.count.height, 1000 * target.square_m);
}

struct FlawText {
    std::string what, advice;
};

FlawText flaw_of(BoardView::Flaw flaw, const Target& target) {
    if (flaw == BoardView::Flaw::larger)
        return {fmt::format("is larger than {}x{} corners", target.count.width, target.count.height),
                "--board takes all inner corners, those at which four squares meet"};
    return {"has the ChArUco pattern from before OpenCV 4.6",
            "a program built with OpenCV 4.7 or later reads it (this is " CV_VERSION
            "), and boards with an odd number of "
            "rows have one pattern only"};
}

} // namespace

std::optional<Camera> given_camera(const std::string& text, double fov_degrees, LensModel lens, cv::Size size) {
    if (!text.empty()) {
        Camera camera = camera_from_argument(text).camera;
        if (camera.pinhole.size.empty())
            camera.pinhole.size = size;
        if (camera.pinhole.size != size)
            throw Error(fmt::format("the images are {}x{}, but the camera ({}) is for {}x{}", size.width, size.height,
                                    camera.origin, camera.pinhole.size.width, camera.pinhole.size.height));
        check(camera);
        return with_lens(camera, lens);
    }
    if (fov_degrees > 0) {
        const double f = size.width / 2.0 / std::tan(fov_degrees * CV_PI / 360);
        return with_lens({centred(f, size), {}, fmt::format("--fov {} degrees", fov_degrees)}, lens);
    }
    return std::nullopt;
}

Camera guessed_camera(const fs::path& picture, LensModel lens, cv::Size size) {
    if (const auto f = picture.empty() ? std::nullopt : exif_focal_length_px(picture, size))
        return with_lens({centred(*f, size), {}, fmt::format("EXIF of {}", picture.filename().string())}, lens);
    const double usual = 0.82 * size.width; // a Kinect's colour camera
    return with_lens({centred(usual, size), {}, "guessed: a usual lens, principal point in the middle"}, lens);
}

Refinement refine_from_boards(const fs::path& folder, const Target& target, const FirstCamera& first,
                              RefineOptions options) {
    if (!fs::is_directory(folder))
        throw Error(folder.string() + ": not a folder of pictures");
    std::vector<std::string> notes;
    const std::vector<Picture> pictures = pictures_in(folder, notes);
    const cv::Size size = pictures.front().pixels.size();
    std::vector<BoardView> views;
    std::map<BoardView::Flaw, std::size_t> flawed;
    for (const Picture& picture : pictures) {
        auto view = find_board(picture.pixels, target, picture.name);
        const std::string file = (folder / picture.name).string();
        if (!view) {
            notes.push_back(fmt::format("no board found in {}; not used.", file));
        } else if (view->flaw != BoardView::Flaw::none) {
            ++flawed[view->flaw];
            notes.push_back(fmt::format("the board in {} {}; not used.", file, flaw_of(view->flaw, target).what));
        } else {
            views.push_back(*std::move(view));
        }
    }
    for (const auto& [flaw, count] : flawed)
        if (count >= views.size())
            throw Error(fmt::format("{}: the board {} in {} of the {} pictures where one is found; {}", folder.string(),
                                    flaw_of(flaw, target).what, count, count + views.size(),
                                    flaw_of(flaw, target).advice));
    if (views.empty())
        throw Error(
            fmt::format("{}: no {} found in any of {} pictures", folder.string(), text_of(target), pictures.size()));
    const auto given = given_camera(first.camera, first.fov_degrees, first.lens, size);
    options.selection.guessed = !given;
    options.what_helps =
        "What helps: more pictures, with the board tilted by 30 to 45 degrees to all sides, and so near "
        "that it reaches the corners of the image.";
    options.what_contradicts =
        "The pictures contradict each other: blur, a shutter that rolls while the camera moves, or a "
        "board that is not flat.";
    const Camera before = given ? *given : first_guess(views, folder / views.front().name, first.lens, size);
    Boards boards(views);
    const std::string why_not = degeneracy(views, boards.start(model_of(before)));
    Refinement result;
    try {
        result = refine(boards, before, camera_groups(before.distortion.model), options, why_not);
    } catch (const Error& failure) { // the pictures left out are often the reason
        std::string all = folder.string() + ": " + failure.what();
        for (const std::string& note : notes)
            all += "\n  " + note;
        throw Error(all);
    }
    result.source = fmt::format("{}, in {} of {} pictures", text_of(target), views.size(), pictures.size());
    result.notes.insert(result.notes.begin(), notes.begin(), notes.end());
    return result;
}

Refinement refine_from_clouds(const Capture& capture, const std::vector<std::size_t>& frames, const FirstCamera& first,
                              RefineOptions options) {
    OrganisedClouds problem;
    std::vector<std::string> notes;
    std::size_t used = 0;
    for (const std::size_t index : frames) {
        try {
            const Frame frame = capture.load(index);
            problem.add(frame.name, *frame.cloud);
            ++used;
        } catch (const std::exception& failure) {
            notes.push_back(fmt::format("{}; not used.", failure.what()));
        }
    }
    if (used == 0)
        throw Error(
            fmt::format("{}: no organised cloud determines its camera: {}", capture.path.string(), notes.front()));
    const cv::Size size = problem.size();
    const auto given = given_camera(first.camera, first.fov_degrees, first.lens, size);
    options.selection.guessed = !given;
    options.what_helps = "What helps: clouds whose points fill the grid up to its corners.";
    const Camera before = given ? *given : guessed_camera({}, first.lens, size);
    Refinement result = refine(problem, before, camera_groups(before.distortion.model), options, "");
    result.source = fmt::format("pixels and points of {} organised cloud{}", used, used == 1 ? "" : "s");
    if (!result.after.distortion.any())
        result.notes.push_back(
            fmt::format("the points lie on a pinhole's rays to {:.1g} px: no lens distortion is left in "
                        "them (rectified, or never there).",
                        result.selection.train_px));
    result.notes.insert(result.notes.begin(), notes.begin(), notes.end());
    return result;
}

} // namespace scanshade
