#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::discrepancy {

/// [1] Probability of a deviation by chance below which it is significant: a thousand tests and channels give
/// one false alarm in ten campaigns.
constexpr double SIGNIFICANT = 1e-4;

/// Upper tail of the chi-square distribution with an even number of degrees of freedom, not below 1e-300.
double chiSquareTail(double value, std::size_t freedom);

/// Benjamini-Hochberg: p-values adjusted to false discovery rates, in the given order.
std::vector<double> falseDiscoveryRates(const std::vector<double>& p_values);

}  // namespace smartmill::discrepancy
