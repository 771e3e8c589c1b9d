// A wall and a picture, 64x48 pixels where nothing else is asked for.
#pragma once

#include <opencv2/core.hpp>

namespace scanshade::tests {

/// A tilted wall 1 to 2 m away, with a hole in the corner.
inline cv::Mat1f wall(cv::Size size = {64, 48}) {
    cv::Mat1f depth(size);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            depth(y, x) = 1.0F + static_cast<float>(x) / static_cast<float>(size.width);
    depth(0, 0) = 0;
    return depth;
}

inline cv::Mat3b picture(cv::Size size = {64, 48}) {
    cv::Mat3b image(size);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            image(y, x) = {static_cast<uchar>(x), static_cast<uchar>(y), 200};
    return image;
}

inline double worst_difference(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF); }

} // namespace scanshade::tests
