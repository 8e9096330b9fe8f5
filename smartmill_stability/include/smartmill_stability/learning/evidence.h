#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace smartmill::stability {

/// [1] Number of equally weighted machines with the same information (Kish). @param weights [1] >= 0
inline double effectiveCount(const std::vector<double>& weights) {
  double sum = 0.0, squares = 0.0;
  for (const double weight : weights) {
    sum += weight;
    squares += weight * weight;
  }
  return squares > 0.0 ? sum * sum / squares : 0.0;
}

/// [1] Likelihood of a chatter frequency, relative to its maximum. @param predicted, heard [Hz]
/// @param error [1] relative standard deviation of both together @param least [1] the largest component heard
/// may be another one than that predicted
inline double frequencyLikelihood(double predicted, double heard, double error, double least) {
  const double off = (predicted / heard - 1.0) / error;
  return std::max(least, std::exp(-0.5 * off * off));
}

/// [1] Likelihood of a verdict. @param chatters by the machine @param heard in the cut @param wrong [1]
/// probability that a cut is not as its machine predicts
inline double verdictLikelihood(bool chatters, bool heard, double wrong) {
  return chatters == heard ? 1.0 : wrong;
}

}  // namespace smartmill::stability
