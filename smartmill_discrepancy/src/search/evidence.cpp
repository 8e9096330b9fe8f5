#include "smartmill_discrepancy/search/evidence.h"

#include <algorithm>
#include <map>
#include <string>

namespace smartmill::discrepancy {
namespace {

// Squares by channel.
std::map<std::string, double> squaresOf(const TwinRunner& runner, const std::vector<double>& values) {
  std::map<std::string, double> squares;
  for (const ChannelSpan& b : runner.spans()) {
    double& sum = squares[b.channel];
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) sum += values[i] * values[i];
  }
  return squares;
}

}  // namespace

double requiredGain(const TwinRunner& runner, const FitResult& less, const FitResult& more,
                    const SearchOptions& options) {
  if (!less.converged || !more.converged) return options.min_gain;
  const auto before = squaresOf(runner, less.residual), after = squaresOf(runner, more.residual),
             signal = squaresOf(runner, runner.measured());
  double floor = 0.0;
  for (const auto& [channel, squares] : signal) {
    if (before.at(channel) - after.at(channel) > options.min_channel_share * (less.chi2 - more.chi2))
      floor += squares * options.twin_accuracy * options.twin_accuracy;
  }
  return std::max(options.min_gain, floor);
}

bool reducesPriorTension(const FitResult& less, const FitResult& more, const SearchOptions& options) {
  return less.bic - more.bic > options.min_prior_gain &&
         less.penalty - more.penalty > options.requiredPenaltyReduction();
}

bool isSignificant(const TwinRunner& runner, const FitResult& less, const FitResult& more,
                   const SearchOptions& options) {
  return less.bic - more.bic > requiredGain(runner, less, more, options) ||
         reducesPriorTension(less, more, options);
}

}  // namespace smartmill::discrepancy
