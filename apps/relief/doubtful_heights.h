// Heights that are probably no heights: numbers for "no data" in files that do not declare them.
#pragma once

#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace scanshade::relief {

/// Counts them, some rows at a time. Nothing is changed: a file's own word decides what has no data.
class DoubtfulHeights {
  public:
    /// Heights in the file's unit, less `base`; NaN = no data.
    void add(const cv::Mat1f& z, double base);
    /// Cells with a height.
    [[nodiscard]] std::int64_t known() const { return zeros_ + others_; }
    /// A sentence for each kind found.
    [[nodiscard]] std::vector<std::string> notes() const;

  private:
    std::map<double, std::int64_t> sentinels_; ///< usual numbers, and how many cells have them
    std::int64_t zeros_ = 0, others_ = 0;
    double nearest_to_zero_ = 1e30; ///< of the others
};

} // namespace scanshade::relief
