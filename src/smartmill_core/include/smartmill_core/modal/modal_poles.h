#pragma once

#include <complex>
#include <cstddef>
#include <vector>

namespace smartmill {

/// FRFs on common lines, each line with its weight.
struct WeightedLines {
  std::vector<double> frequency;                         ///< [Hz] rising
  std::vector<std::vector<std::complex<double>>> value;  ///< [unit] per FRF and line
  std::vector<std::vector<double>> weight;               ///< [1/unit] of real and imaginary part each

  std::size_t size() const { return frequency.size(); }
  std::size_t frfs() const { return value.size(); }
  double step() const { return (frequency.back() - frequency.front()) / static_cast<double>(size() - 1); }
};

/// A pole of a structure in a model of one order.
struct Pole {
  int order = 0;               ///< of the denominator
  double frequency = 0.0;      ///< [Hz] undamped
  double damping_ratio = 0.0;  ///< [1]
  bool stable = false;         ///< the order before has nearly the same pole

  double halfWidth() const { return frequency * damping_ratio; }  ///< [Hz] of its peak
};

/// Lines and orders that polesByOrder() uses, and how poles are compared from order to order.
struct PoleSearch {
  std::size_t first = 0, last = 0;  ///< lines first .. last - 1
  int largest_order = 60;
  int order_step = 1;
  double same_frequency = 0.003;   ///< [1] largest change of a pole from order to order within a track
  double stable_frequency = 0.01;  ///< [1] and of a stable pole in the diagram, as is usual
  double stable_damping = 0.2;     ///< [1] the same for its damping ratio, which scatters more
  std::size_t least_orders = 3;    ///< of a persistent pole; computational ones persist over two by chance
};

/// Poles by the poly-reference least-squares complex frequency method (Peeters, Van der Auweraer, Guillaume
/// and Leuridan, 2004; here one common denominator with complex coefficients in z = exp(i turn (f - f0) /
/// span), so that any interval of the lines can be used alone), for every order up to the largest: the points
/// of a stabilization diagram. The lowest coefficient is 1, which gives noise poles negative damping; these
/// are omitted.
std::vector<Pole> polesByOrder(const WeightedLines& lines, const PoleSearch& search);

/// Poles that are stable over the orders; their `order` is the number of orders. Most persistent first.
std::vector<Pole> persistentPoles(const std::vector<Pole>& poles, const PoleSearch& search);

}  // namespace smartmill
