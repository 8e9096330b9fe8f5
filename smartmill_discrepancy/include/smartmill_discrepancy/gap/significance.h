#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::discrepancy {

/// Upper tail of the chi-square distribution with an even number of degrees of freedom, not below 1e-300.
double chiSquareTail(double value, std::size_t freedom);

/// Benjamini-Hochberg: p-values adjusted to false discovery rates, in the given order.
std::vector<double> falseDiscoveryRates(const std::vector<double>& p_values);

}  // namespace smartmill::discrepancy
