#include "gap/orders.h"

#include <algorithm>
#include <cmath>

namespace smartmill::discrepancy {

OrderBasis::OrderBasis(const std::vector<double>& angle) : samples_(angle.size()) {
  constexpr auto WIDTH = static_cast<std::size_t>(LANES);
  const std::size_t groups = (samples_ + WIDTH - 1) / WIDTH;
  cosine_.assign(groups, Lanes::Ones());
  sine_.assign(groups, Lanes::Zero());
  for (std::size_t i = 0; i < samples_; ++i) {
    const auto lane = static_cast<Eigen::Index>(i % WIDTH);
    cosine_[i / WIDTH][lane] = std::cos(angle[i]);
    sine_[i / WIDTH][lane] = std::sin(angle[i]);
  }
}

std::vector<double> OrderBasis::along(const std::vector<double>& values, std::size_t count) const {
  constexpr auto WIDTH = static_cast<std::size_t>(LANES);
  std::vector<double> sums(2 * count + 1, 0.0);
  for (std::size_t g = 0; g < cosine_.size(); ++g) {
    Lanes value = Lanes::Zero(), cosine = Lanes::Ones(), sine = Lanes::Zero();
    std::copy_n(values.data() + g * WIDTH, std::min(WIDTH, samples_ - g * WIDTH), value.data());
    const Lanes c1 = cosine_[g], s1 = sine_[g];
    sums[0] += value.sum();
    for (std::size_t k = 1; k <= count; ++k) {
      const Lanes next = cosine * c1 - sine * s1;
      sine = cosine * s1 + sine * c1;
      cosine = next;
      sums[2 * k - 1] += (value * cosine).sum();
      sums[2 * k] += (value * sine).sum();
    }
  }
  return sums;
}

std::vector<double> OrderBasis::sumOf(const std::vector<double>& lines) const {
  constexpr auto WIDTH = static_cast<std::size_t>(LANES);
  std::vector<double> values(samples_);
  for (std::size_t g = 0; g < cosine_.size(); ++g) {
    Lanes sum = Lanes::Constant(lines[0]), cosine = Lanes::Ones(), sine = Lanes::Zero();
    const Lanes c1 = cosine_[g], s1 = sine_[g];
    for (std::size_t k = 1; 2 * k < lines.size(); ++k) {
      const Lanes next = cosine * c1 - sine * s1;
      sine = cosine * s1 + sine * c1;
      cosine = next;
      sum += lines[2 * k - 1] * cosine + lines[2 * k] * sine;
    }
    std::copy_n(sum.data(), std::min(WIDTH, samples_ - g * WIDTH), values.data() + g * WIDTH);
  }
  return values;
}

}  // namespace smartmill::discrepancy
