#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_discrepancy/fit/fit.h"

namespace smartmill::discrepancy {

/// What a table over one revolution says beside a straight line over the feed: cosine and sine of each order
/// of each force channel at feeds per tooth, nothing at the first and the last one.
struct Bend {
  std::vector<double> chips;                                            ///< [m] rising
  std::map<double, std::map<std::string, std::vector<double>>> orders;  ///< [N] two numbers a chip

  /// Cosine (or level) and sine of an order [N], straight between the feeds.
  std::array<double, 2> at(double order, const std::string& channel, double chip) const;
};

/// How a cutting force goes with the chip.
struct ChipLaw {
  double exponent = 0.0;    ///< chip coefficients go with h^-exponent
  double onset = 0.0;       ///< [m] edge coefficients with 1 - exp(-h / onset); 0: constant
  double edge_share = 1.0;  ///< [1] of the model's edge coefficients

  bool bends() const { return exponent > 0.0 || onset > 0.0; }
};

/// A cutting law that bends over the chip, seen through a sensor that nobody knows.
struct BentLaw {
  ChipLaw in_plane;               ///< of tangential and radial forces, which fx and fy mix
  ChipLaw axial;                  ///< the same one where the lines of fz do not ask for another
  double squares = 0.0;           ///< that it leaves of the lines, each record over what does not come again
  double straight_squares = 0.0;  ///< the same of the law that is straight over the chip
  double lines = 0.0;             ///< [1] numbers compared
  std::vector<double> turned;     ///< [rad] by which each of the runner's tests lies further
  Bend bend;                      ///< of what the sensor makes of it, beside what the model's own law bends

  bool bends() const { return in_plane.bends() || axial.bends(); }
  /// Squares that a law of its own for some of the forces must take to be believed.
  double costOfALaw() const;
};

/// Law and sensor found together, from cuts that differ in feed only: through any linear sensor each line at
/// the tooth passing is the law's own line times one gain, the same at every feed. The feeds of the fit tests
/// choose the law with the gains that fit it best, that of the axial force by itself; each record counts over
/// what of it does not come again with the revolution. A record whose angle nobody measured lies where the
/// lines say; without a law a turn that grows with the feed would pass for a course of the lines.
/// @param cuts of the runner, three feeds or more @param nominal the tool is even in it @param model as it is
/// now: the bend is beside it
/// @return nothing where lines cannot be told, or the model has a law that bends
std::optional<BentLaw> bentLaw(const TwinRunner& runner, const std::vector<std::size_t>& cuts,
                               const MachineModel& nominal, const MachineModel& model);

}  // namespace smartmill::discrepancy
