#pragma once

#include <cstddef>
#include <vector>

namespace smartmill {

/// All throw Error on an empty series. Units follow the input.
double mean(const std::vector<double>& values);
double rms(const std::vector<double>& values);
/// Sample standard deviation (n - 1); needs two values.
double standardDeviation(const std::vector<double>& values);
double median(std::vector<double> values);
/// [1] Ratio of the 97.5 % quantiles of Student's t and the normal distribution (Abramowitz and Stegun
/// 26.7.5, which is 3 % short at two degrees of freedom and less beyond). @param freedom > 0
double studentOverNormal(double freedom);
/// @param share 0..1, linear interpolation between order statistics (10th percentile: 0.1).
double percentile(std::vector<double> values, double share);
/// First index of a value that is NaN or infinite; values.size() when all are finite.
std::size_t firstNotFinite(const std::vector<double>& values);
/// Longest run of equal extreme values; a run of three or more at the extreme of a noisy record means
/// clipping.
std::size_t longestRunAtExtreme(const std::vector<double>& values);

}  // namespace smartmill
