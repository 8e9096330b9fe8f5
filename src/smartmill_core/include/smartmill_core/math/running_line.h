#pragma once

namespace smartmill {

/// Least squares line y = level + slope x through points that are added one by one.
class RunningLine {
 public:
  void add(double x, double y) {
    ++count_;
    const double from = x - mean_x_;
    mean_x_ += from / count_;
    mean_y_ += (y - mean_y_) / count_;
    xx_ += from * (x - mean_x_);
    xy_ += from * (y - mean_y_);
  }
  int count() const { return count_; }
  /// Whether there are points at two places.
  bool isDetermined() const { return xx_ > 0.0; }
  double slope() const { return xy_ / xx_; }
  double level() const { return mean_y_ - slope() * mean_x_; }
  double at(double x) const { return mean_y_ + slope() * (x - mean_x_); }

 private:
  int count_ = 0;
  double mean_x_ = 0.0, mean_y_ = 0.0, xx_ = 0.0, xy_ = 0.0;  // sums about the means
};

}  // namespace smartmill
