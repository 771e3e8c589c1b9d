// Least squares of a straight line.
#pragma once

namespace scanshade {

/// y = slope * x + offset
struct Line {
    double slope = 0, offset = 0;
    [[nodiscard]] double at(double x) const { return slope * x + offset; }
    [[nodiscard]] double residual(double x, double y) const { return y - at(x); }
};

/// With running means, so that nothing cancels (Welford 1962).
class LineFit {
  public:
    void add(double x, double y) {
        ++count_;
        const double dx = x - mean_x_;
        mean_x_ += dx / count_;
        mean_y_ += (y - mean_y_) / count_;
        xx_ += dx * (x - mean_x_);
        xy_ += dx * (y - mean_y_);
    }
    [[nodiscard]] bool determined() const { return count_ >= 3 && xx_ > count_ * 1e-14; }
    [[nodiscard]] Line line() const { return {xy_ / xx_, mean_y_ - xy_ / xx_ * mean_x_}; }

  private:
    double count_ = 0, mean_x_ = 0, mean_y_ = 0, xx_ = 0, xy_ = 0;
};

} // namespace scanshade
