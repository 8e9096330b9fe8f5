#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/cutting/tool.h"
#include "smartmill_sim/twin/cutting_process.h"

namespace smartmill::sim {

/// Milling with a vibrating tool at steady speed and feed: what CuttingProcess gives then, from the history
/// of the tip's displacement instead of a stored surface. A tooth that stands at an angle meets what each
/// tooth before it left there one pitch, two pitches ... ago, whatever the height on the edge; the chip is
/// the least of these distances over the last revolutions (regeneration, loss of contact, runout, uneven
/// pitch; eq. 2.2, 6.1).
class RegenerativeCut {
 public:
  /// @param time_step [s] > 0 @param radius_offset [m] of each tooth, empty: none. @throws Error on an
  /// impossible tool.
  RegenerativeCut(const ToolGeometry& tool, const CuttingLaw& law, double time_step,
                  std::vector<double> radius_offset = {});

  /// Material begins; until now the tool had not vibrated. @throws Error on an impossible arc or a standing
  /// spindle.
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now);
  const std::vector<ContactArc>& arcs() const { return arcs_; }
  void setDepths(const std::vector<double>& depths);
  void setLaw(const CuttingLaw& law) { law_ = law; }

  /// Force on the tool when tooth 1 stands at an angle [rad] and the tip is displaced [m].
  CuttingForce at(double angle, const std::array<double, 2>& displacement);
  /// Ends the time step with the tip there [m].
  void push(const std::array<double, 2>& displacement);

 private:
  struct Pass {         // of an earlier tooth, as one tooth sees it
    std::size_t delay;  // index into delays_
    double offset;      // [m] radius of this tooth over that one's
    double ahead;       // [rad]
  };
  struct Delay {
    std::size_t whole;              // steps
    std::array<double, 4> weights;  // of the displacement whole + 2, + 1, + 0, - 1 steps ago
    std::array<double, 2> value;    // [m]
  };
  struct Plane {  // chip = offset + x sin + y cos
    double offset, x, y;
  };
  struct Spread {        // rotations from the middle of a cell to its ends and to its Gauss points
    double half = -1.0;  // [rad]
    double end_sine, end_cosine, gauss_sine, gauss_cosine;
  };
  void spread(double half);
  double chip(double sine, double cosine) const;
  void keepNear(double sine, double cosine);
  void add(double sine, double cosine, double weight, CuttingForce& sum, double& tangential) const;
  void cut(double from, double to, CuttingForce& sum, double& tangential);

  ToolGeometry tool_;
  CuttingLaw law_;
  double time_step_, lag_;
  std::vector<double> offset_, tooth_angle_;
  std::vector<ContactArc> arcs_;
  std::vector<std::vector<Pass>> passes_;  // of each tooth
  std::vector<Delay> delays_;
  std::vector<std::array<double, 2>> history_;  // [m] ring; size a power of two
  std::size_t newest_ = 0;
  std::vector<Plane> planes_, near_;  // of all passes before one tooth; those that may give a cell's chip
  std::size_t near_count_ = 0;
  Spread spread_;
  std::array<double, 2> feed_{{0, 0}};     // [m/rad]
  std::array<double, 2> damping_{{0, 0}};  // [N/m] radial force of process damping: x sin + y cos
  double speed_ = 0.0;
};

}  // namespace smartmill::sim
