#pragma once

#include <complex>
#include <cstdint>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_stability/coupling/spindle.h"
#include "smartmill_stability/coupling/tool_assembly.h"

namespace smartmill::stability {

/// Finite elements of a shaft that bends in one plane, of its own: a chain of Timoshenko elements
/// (Przemieniecki), grounded by springs and interrupted by joints. Nodes have deflection and slope.
class ShaftChain {
 public:
  using Block = Eigen::Matrix2cd;

  /// Appends elements of a round section. @param young, density [N/m2], [kg/m3] @param loss [1]
  void addShaft(double length, double diameter, double young, double density, double loss, int elements);
  /// Appends a node that is joined by springs and dampers: [N/m], [N m/rad], [N s/m], [N m s/rad].
  void addJoint(double stiffness, double tilting, double damping, double tilting_damping);
  /// Bearing at the last node: spring [N/m] with a loss factor to a housing mass [kg] on a spring [N/m].
  void addBearing(double stiffness, double loss, double housing_mass, double housing_stiffness);
  int last() const { return static_cast<int>(nodes_.size()) - 1; }

  /// [m/N] Receptance between two nodes at f [Hz].
  std::complex<double> receptance(int response, int force, double f) const;

 private:
  struct Link {  // of a node to the next
    Eigen::Matrix4cd stiffness = Eigen::Matrix4cd::Zero();
    Eigen::Matrix4d mass = Eigen::Matrix4d::Zero(), damping = Eigen::Matrix4d::Zero();
  };
  struct Node {
    double bearing = 0.0, loss = 0.0, housing_mass = 0.0, housing_stiffness = 0.0;
  };
  std::vector<Node> nodes_ = std::vector<Node>(1);
  std::vector<Link> links_;
};

/// A drawn spindle with one holder, what is known of both, and the measurements.
struct DrawnShop {
  Gauge gauge;
  GaugeTaps taps;
  std::vector<BeamSegment> holder;     ///< nominal
  std::vector<TappedTool> references;  ///< three tools, tapped once, for the contact
};

/// A tool in the spindle: what is known, a tap of it, and the truth.
struct DrawnTool {
  ToolDescription tool;   ///< nominal
  FrequencyResponse tap;  ///< with noise
  FrequencyResponse tip;  ///< without
};

/// Spindles, holders and tools of a workshop. A holder takes one shank diameter (8 .. 20 mm). True tools
/// differ from the nominal ones: Young's modulus 2 %, flute ratio 0.8 +- 0.025, contact 15 % about that of
/// the holder; the true holder 2 % in Young's modulus. FRFs have noise of 0.7 % of each line and a common
/// error of calibration of 1 %.
class ToolShop {
 public:
  explicit ToolShop(std::uint64_t seed);
  const DrawnShop& shop() const { return shop_; }
  DrawnTool drawTool();

 private:
  struct Truth {
    double shaft_diameter, overhang, span, front, rear, housing_mass, housing_stiffness, loss;
    double holder_young, shank, nose, nose_length, base, base_length;
    double contact, tilting, contact_damping, tilting_damping;
  };
  void appendSpindle(ShaftChain& chain) const;
  FrequencyResponse measured(const FrequencyResponse& exact);
  DrawnTool build(double stickout, double fluted, int teeth);
  double around(double share);  ///< log-normal factor
  double between(double low, double high);

  std::mt19937_64 random_;
  Truth truth_{};
  DrawnShop shop_;
};

}  // namespace smartmill::stability
