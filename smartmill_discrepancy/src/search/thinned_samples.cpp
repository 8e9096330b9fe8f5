#include "search/thinned_samples.h"

#include <cmath>
#include <random>

namespace smartmill::discrepancy {

ThinnedSamples::ThinnedSamples(const TwinRunner& runner, const ThinningOptions& options) {
  std::minstd_rand random(1);
  for (const ChannelSpan& b : runner.spans()) {
    const std::size_t every = b.size < options.few ? 1 : options.every;
    for (std::size_t i = 0; i + every <= b.size; i += every) {
      rows_.push_back(static_cast<Eigen::Index>(b.offset + i + (every > 1 ? random() % every : 0)));
      weights_.push_back(std::sqrt(static_cast<double>(every)));
    }
  }
}

Eigen::MatrixXd ThinnedSamples::weighted(Eigen::MatrixXd values) const {
  const Eigen::Map<const Eigen::VectorXd> weights(weights_.data(),
                                                  static_cast<Eigen::Index>(weights_.size()));
  values.array().colwise() *= weights.array();
  return values;
}

}  // namespace smartmill::discrepancy
