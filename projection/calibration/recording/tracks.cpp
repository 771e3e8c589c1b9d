// Detects features, matches them, and chains the matches.
#include "projection/calibration/recording/tracks.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <set>
#include <tuple>

namespace scanshade::calibration {
namespace {

struct Features {
    std::vector<cv::KeyPoint> points;
    cv::Mat descriptors;
};

/// OpenCV's SIFT doubles the image, by which pixel u comes to 2 u + 0.5, and then halves coordinates: all points are a
/// quarter of a pixel too far right and down (OpenCV issue 23124; from 4.8 on a flag, off by default, undoes that).
constexpr float sift_offset_px = 0.25F;

std::vector<Features> features_of(const std::vector<cv::Mat1b>& images) {
    constexpr int most = 1000;
    std::vector<Features> all(images.size());
    cv::parallel_for_({0, static_cast<int>(images.size())}, [&](const cv::Range& range) {
        const auto detector = cv::SIFT::create(most);
        for (int i = range.start; i < range.end; ++i) {
            detector->detectAndCompute(images[i], cv::noArray(), all[i].points, all[i].descriptors);
            for (cv::KeyPoint& point : all[i].points)
                point.pt -= cv::Point2f(sift_offset_px, sift_offset_px);
        }
    });
    return all;
}

/// Mutual best matches that are clearly better than the second best, and that agree with one fundamental matrix.
std::vector<std::pair<int, int>> matches_of(const Features& a, const Features& b) {
    constexpr float ratio = 0.8F;     // Lowe 2004, section 7.1
    constexpr double epipolar_px = 2; // generous: lens distortion bends epipolar lines
    if (a.points.size() < 8 || b.points.size() < 8)
        return {};
    std::vector<std::vector<cv::DMatch>> forth;
    std::vector<cv::DMatch> back;
    const cv::BFMatcher matcher(cv::NORM_L2);
    matcher.knnMatch(a.descriptors, b.descriptors, forth, 2);
    matcher.match(b.descriptors, a.descriptors, back);
    std::vector<std::pair<int, int>> pairs;
    std::vector<cv::Point2f> in_a, in_b;
    for (const auto& best : forth)
        if (best.size() == 2 && best[0].distance < ratio * best[1].distance &&
            back[best[0].trainIdx].trainIdx == best[0].queryIdx) {
            pairs.emplace_back(best[0].queryIdx, best[0].trainIdx);
            in_a.push_back(a.points[best[0].queryIdx].pt);
            in_b.push_back(b.points[best[0].trainIdx].pt);
        }
    if (pairs.size() < 15)
        return {};
    std::vector<unsigned char> good;
    cv::setRNGSeed(1); // the same recording gives the same tracks
    cv::findFundamentalMat(in_a, in_b, cv::USAC_DEFAULT, epipolar_px, 0.999, 2000, good);
    std::vector<std::pair<int, int>> kept;
    for (std::size_t i = 0; i < pairs.size() && i < good.size(); ++i)
        if (good[i])
            kept.push_back(pairs[i]);
    return kept;
}

/// Sets of features joined by matches (Galler and Fischer 1964).
class Chains {
  public:
    explicit Chains(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
    int root(int i) {
        while (parent_[i] != i)
            i = parent_[i] = parent_[parent_[i]];
        return i;
    }
    void join(int a, int b) { parent_[root(a)] = root(b); }

  private:
    std::vector<int> parent_;
};

/// SIFT gives a corner with several directions several features, and so several tracks. Only the longest is kept: the
/// others are no evidence of their own.
std::vector<Track> without_repeats(std::vector<Track> tracks) {
    std::stable_sort(tracks.begin(), tracks.end(),
                     [](const Track& a, const Track& b) { return a.observations.size() > b.observations.size(); });
    std::set<std::tuple<int, float, float>> seen;
    std::erase_if(tracks, [&](const Track& track) {
        const bool repeated =
            std::any_of(track.observations.begin(), track.observations.end(), [&](const Track::Observation& s) {
                return seen.contains({s.frame, s.pixel.x, s.pixel.y});
            });
        if (!repeated)
            for (const Track::Observation& s : track.observations)
                seen.insert({s.frame, s.pixel.x, s.pixel.y});
        return repeated;
    });
    return tracks;
}

/// The first tracks of each part of the image, in turn, so that no textured corner dominates.
std::vector<Track> spread(std::vector<Track> tracks, cv::Size size, std::size_t most) {
    constexpr int cells = 8;
    std::map<std::pair<int, int>, std::vector<std::size_t>> by_cell;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        const cv::Point2d pixel = tracks[i].observations.front().pixel;
        by_cell[{static_cast<int>(pixel.x * cells / size.width), static_cast<int>(pixel.y * cells / size.height)}]
            .push_back(i);
    }
    std::vector<Track> chosen;
    for (std::size_t rank = 0; rank < tracks.size() && chosen.size() < most; ++rank)
        for (const auto& [cell, indices] : by_cell)
            if (rank < indices.size() && chosen.size() < most)
                chosen.push_back(tracks[indices[rank]]);
    return chosen;
}

} // namespace

std::vector<Track> find_tracks(const std::vector<cv::Mat1b>& images, int shortest, std::size_t most) {
    if (images.empty())
        return {};
    const std::vector<Features> features = features_of(images);
    std::vector<int> first(features.size() + 1, 0);
    for (std::size_t i = 0; i < features.size(); ++i)
        first[i + 1] = first[i] + static_cast<int>(features[i].points.size());

    std::vector<std::pair<int, int>> frame_pairs;
    const int count = static_cast<int>(images.size());
    for (const int step : {1, 2, 4, 8})
        for (int i = 0; i + step < count; ++i)
            frame_pairs.emplace_back(i, i + step);
    std::vector<std::vector<std::pair<int, int>>> matches(frame_pairs.size());
    cv::parallel_for_({0, static_cast<int>(frame_pairs.size())}, [&](const cv::Range& range) {
        for (int i = range.start; i < range.end; ++i)
            matches[i] = matches_of(features[frame_pairs[i].first], features[frame_pairs[i].second]);
    });

    Chains chains(static_cast<std::size_t>(first.back()));
    for (std::size_t i = 0; i < matches.size(); ++i)
        for (const auto& [a, b] : matches[i])
            chains.join(first[frame_pairs[i].first] + a, first[frame_pairs[i].second] + b);
    std::map<int, Track> by_root;
    for (int frame = 0; frame < count; ++frame)
        for (int i = first[frame]; i < first[frame + 1]; ++i)
            by_root[chains.root(i)].observations.push_back({frame, features[frame].points[i - first[frame]].pt});
    std::vector<Track> tracks;
    for (auto& [root, track] : by_root) {
        std::set<int> frames;
        for (const Track::Observation& observation : track.observations)
            frames.insert(observation.frame);
        // A track with two features in one image contains a wrong match.
        if (frames.size() == track.observations.size() && static_cast<int>(frames.size()) >= shortest)
            tracks.push_back(std::move(track));
    }
    return spread(without_repeats(std::move(tracks)), images.front().size(), most);
}

} // namespace scanshade::calibration
