#include "search/thinned_samples.h"

#include <cmath>
#include <random>

namespace smartmill::discrepancy {
namespace {

struct ThinningOptions {
  std::size_t every = 4;  ///< samples of which one is used: a scan only compares gains
  std::size_t few = 256;  ///< samples of a span below which all are used
};

const ThinningOptions LIMITS;

}  // namespace

ThinnedSamples::ThinnedSamples(const TwinRunner& runner) {
  std::minstd_rand random(1);
  for (const ChannelSpan& b : runner.spans()) {
    const std::size_t every = b.size < LIMITS.few ? 1 : LIMITS.every;
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
