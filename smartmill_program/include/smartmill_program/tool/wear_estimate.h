#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_program/tool/sharp_tools.h"

namespace smartmill::program {

struct WearParameters {
  double force_error = 0.01;
  double coefficient_error = 0.03;
  double cut_error = 0.02;
  double edge_error = 0.25;
  int cuts = 20;

  void declare(ParameterTable& table) {
    table.number("force_error", force_error, "1", Range::notNegative(),
                 "standard deviation of the force sensor's gain, relative");
    table.number("coefficient_error", coefficient_error, "1", Range::notNegative(),
                 "standard deviation of a coefficient that states none, relative");
    table.number("cut_error", cut_error, "1", Range::positive(),
                 "standard deviation of the force of a cut against the law of the others (depth, stock), "
                 "relative");
    table.number(
        "edge_error", edge_error, "1", Range::positive(),
        "largest standard deviation with which the wear of the edge coefficients is stated, relative");
    table.number("wear_cuts", cuts, "1", Range::closed(2, 1000),
                 "most recent cuts of a tool from which the wear of the edge coefficients follows");
  }
  /// @throws Error naming key and value.
  void validate() const { checkBounds(*this); }
};

/// Force of a steady cut relative to that of a sharp tool.
struct CutWear {
  double stamp = 0.0;  ///< [s] last revolution
  CuttingCondition condition;
  std::size_t revolutions = 0;
  double wear = 0.0;      ///< [1] mean force over the expected one, minus 1
  double wear_std = 0.0;  ///< [1] scatter of the revolutions, gain of the sensor, coefficients
  double edge_wear = std::numeric_limits<double>::quiet_NaN();  ///< [1] NaN: not determined
  double edge_wear_std = std::numeric_limits<double>::quiet_NaN();
};

/// Wear of a tool from the mean force of steady cuts. The expected force is that of the mean force matrix
/// (mechanistic.h) with the coefficients of the sharp tool. The measured mean force is projected on its
/// direction in the frame of the feed; runout does not change it as long as every tooth cuts.
///
/// With the tangential coefficients alone (a load meter's) the tangential forces of the teeth are separated
/// from the radial ones. In the plane, F = Ktc C + Kte E + i (Krc C + Kre E), with C and E the mean over a
/// revolution of -h exp(-i phi) and -exp(-i phi) over the edges in cut. The component of F across i C and i E
/// depends on the tangential force alone. C and E are parallel in a slot and in every arc that is symmetric
/// about the feed's normal, else up to some degrees apart; where the radial force lies between them is not
/// known and is part of the standard deviation, as is an error of the two components of the sensor.
///
/// Wear increases the edge coefficients, hardly those of the chip. From cuts with different feeds per tooth,
/// least squares of force = s chip part + e edge part give the wear of the edge coefficients, e - 1.
class WearEstimate {
 public:
  /// @throws Error on a parameter out of range.
  explicit WearEstimate(const WearParameters& parameters);

  /// A cut begins; without coefficients or for other kinds there is no estimate.
  /// @param sharp coefficients of the sharp tool; krc, kre NaN: not known, the tangential forces are
  /// compared; std_dev NaN: coefficient_error
  void begin(const CuttingCondition& condition, const std::optional<SharpCoefficients>& sharp);
  /// Mean force [N] over a revolution of the steady cut, x + i y of the machine.
  void add(double time, std::complex<double> force);
  /// The present cut up to now; empty: no expectation or less than three revolutions.
  std::optional<CutWear> present() const;
  /// A new tool of the same name: the cuts so far, the present one included, are not its own.
  void forget();
  /// Ends the cut. @return as present()
  std::optional<CutWear> end();

 private:
  struct Cut {
    double force, chip, edge;  // [N] measured, expected parts
  };
  bool expectTotal(const std::array<std::complex<double>, 6>& part);
  bool expectTangential(const std::array<std::complex<double>, 6>& part, std::complex<double> chip,
                        std::complex<double> edge);
  std::pair<double, double> edgeWear(const std::deque<Cut>& cuts) const;

  WearParameters parameters_;
  std::optional<CuttingCondition> condition_;
  std::complex<double> direction_ = {1.0, 0.0};  // on which forces are projected, machine
  double chip_ = 0.0, edge_ = 0.0;               // [N] expected parts along direction_
  // Without radial coefficients: directions of tangential and radial force with the feed along x; [rad]
  // standard deviation of the latter.
  std::complex<double> tangential_, radial_;
  double radial_angle_std_ = std::numeric_limits<double>::quiet_NaN();  // NaN: all coefficients are known
  double expected_std_ = 0.0;                                           // [1]
  std::size_t count_ = 0;
  double sum_ = 0.0, squares_ = 0.0;  // of measured over expected
  std::complex<double> force_sum_;    // [N] of the revolutions, machine
  double last_ = 0.0;                 // [s]
  std::string tool_;
  std::map<std::string, std::deque<Cut>> cuts_;  // by tool
};

}  // namespace smartmill::program
