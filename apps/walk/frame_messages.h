// A computed frame as messages of ROS, for run.mcap.
#pragma once

#include "apps/frame/frame_images.h"
#include "apps/results/mcap_recording.h"

#include <string>

namespace scanshade {

/// What the images of a frame must be made for, besides what is written: `outputs` with everything that messages hold.
[[nodiscard]] Outputs with_messages(const Outputs& outputs);

/// The frame's group of messages: its name and numbers, transform, camera, images and points. Images show the frame's
/// scene, and camera_info is the camera of their pixels, lens included. Points lie in the depth camera's frame, or in
/// the cloud's. PNGs that are written already are taken from their files. The row may get warnings.
[[nodiscard]] std::string frame_messages(Work& work, const FrameImages& images, const Outputs& outputs,
                                         const McapRecording& recording);

} // namespace scanshade
