#pragma once

#include <array>
#include <complex>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/cutting/speed_variation.h"
#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::stability {

/// One vibration mode of the tool relative to the workpiece: q'' + 2 zeta w q' + w^2 q = input . F;
/// displacement of the tool: output q. Both vectors are in 1/sqrt(kg) for unit modal mass. A mode along one
/// axis has input and output along that axis; cross terms are modes whose vectors have both components.
struct SystemMode {
  double frequency = 0.0;      ///< [Hz] > 0
  double damping_ratio = 0.0;  ///< [1] 0 < value < 1
  std::array<double, 2> input{{0.0, 0.0}};
  std::array<double, 2> output{{0.0, 0.0}};
};

enum class Cut { milling, turning };

/// Causes of different chips at different teeth: runout, a serrated edge and, with uneven pitch or radius,
/// the forced vibration. A tooth may then miss the cut locally, and a later tooth cuts the material of
/// several. Stability is that of the vibration about the forced vibration with its contact. With forces
/// proportional to the chip thickness only the ratio of the offsets to the feed matters.
struct ChipGeometry {
  double feed = 0.0;                  ///< [m] per tooth (mean over the teeth) > 0
  std::vector<double> radius_offset;  ///< [m] runout of each tooth; empty: none
  bool forced_vibration = true;       ///< false: contact of a rigid tool
  double kte = 0.0, kre = 0.0;  ///< [N/m] tangential and radial edge force, of the forced vibration only
};

/// A milling or turning system: dynamics of the tool tip and regeneration. Angles are immersion angles,
/// clockwise from +y, the feed is along x; forces act on the tool (docs/formats.md).
struct RegenerativeSystem {
  /// Dynamics: modes for every solver; receptances (measured or computed) for zero_order and multi_frequency,
  /// which use the modes without them.
  std::vector<SystemMode> modes;
  std::optional<ToolTipResponse> response;

  Cut cut = Cut::milling;
  int teeth = 1;              ///< 1..20
  std::vector<double> pitch;  ///< [rad] tooth k to tooth k + 1, sum 2 pi; empty: even
  double helix = 0.0;         ///< [rad] 0 <= helix < 80 deg; requires the diameter
  double diameter = 0.0;      ///< [m] of the tool (milling) or of the workpiece (turning)
  /// Shape of the edges (milling). Inclined ones press along the tool too, where it is rigid: at an
  /// inclination kappa the force across the tool is that of kt and kr sin(kappa) - ka cos(kappa) for a metre
  /// of height (EdgeSlice). With a helix angle of each tooth the delays change with height (Sims, Mann,
  /// Huyanan 2008; Sellmeier and Denkena 2011). A serrated edge requires a chip geometry. Supported by the
  /// Floquet solvers and multi_frequency; zero_order excludes a helix angle of each tooth.
  EdgeShape edge;
  double entry = 0.0;       ///< [rad] milling: entry angle; turning: constant angle of the edge
  double exit = units::PI;  ///< [rad] > entry; unused in turning
  double kt = 0.0;          ///< [N/m2] tangential
  double kr = 0.0;          ///< [N/m2] radial, in the frame of the edge
  double ka = 0.0;          ///< [N/m2] axial; read where the edge is inclined
  /// [N/m2] Tangential and radial coefficient at an immersion angle, for a nonlinear force law linearised at
  /// the chip thickness of that angle. Empty: kt and kr; otherwise kt and kr only set the scale. Supported by
  /// the Floquet solvers, without a chip geometry, for straight edges.
  std::function<std::array<double, 2>(double angle)> along_arc;
  /// [N/m] >= 0 Process damping: force on the flank = coefficient x depth x velocity / cutting speed,
  /// velocity along the chip normal, into the material.
  double damping_tangential = 0.0;
  double damping_radial = 0.0;
  /// [1] Overlap factor with the previous cut (Kim's mu): 1 for milling and plunge turning, 0 for threading.
  double overlap = 1.0;
  /// Milling: actual contact of the teeth. Absent: every tooth cuts along its whole arc the surface left by
  /// the previous tooth. Supported by the Floquet solvers; zero_order uses the mean over whole serration
  /// waves.
  std::optional<ChipGeometry> chip;
  /// Variation of the spindle speed about the speed of the chart; the phase of the variation is 0 when tooth
  /// 1 is at the immersion angle 0. Supported by collocation, without a chip geometry.
  std::optional<SpeedVariation> variation;

  /// Process damping as the effect process_damping: radial `coefficient` [N/m], tangential 0.3 of it.
  void setProcessDamping(double coefficient);
  bool hasProcessDamping() const { return damping_radial > 0.0 || damping_tangential > 0.0; }
  /// @throws Error naming the quantity and its value.
  void validate() const;
  bool evenPitch() const;           ///< at all heights
  double pitchOf(int tooth) const;  ///< [rad] at the tip
  ToolGeometry tool() const;        ///< of a milling system
  /// Whether the feedback for a metre of depth changes with the depth.
  bool dependsOnHeight() const { return helix > 0.0 || !edge.straight(); }
  /// [N/m2] Radial coefficient for a metre of height, mean from the tip to a depth [m] > 0.
  double meanRadial(double depth) const;
  /// The system with straight edges that has the same mean coefficients over a depth [m].
  RegenerativeSystem straightened(double depth) const;
};

/// Modes of a receptance along one axis (0 x, 1 y). A residual compliance becomes a well-damped mode at four
/// times the highest natural frequency.
std::vector<SystemMode> systemModes(const ModalModel& model, int axis);

/// Modes of x and y together.
std::vector<SystemMode> systemModes(const ModalModel& x, const ModalModel& y);

/// Receptance of the tool tip at f [Hz]: xx, xy, yx, yy [m/N].
std::array<std::complex<double>, 4> receptance(const std::vector<SystemMode>& modes, double f);

/// Receptances with cross terms at frequencies from low to high [Hz], dense around each mode.
ToolTipResponse responseOf(const std::vector<SystemMode>& modes, double low, double high, std::size_t lines);
/// The same at ascending frequencies [Hz].
ToolTipResponse responseOf(const std::vector<SystemMode>& modes, std::vector<double> frequencies);

/// Type of the loss of stability: Hopf (quasi-periodic), flip (period doubling: the vibration repeats every
/// two principal periods), fold (multiplier +1: static loss of stability).
enum class Kind { none, hopf, flip, fold };
const char* nameOf(Kind kind);

/// First loss of stability at one speed.
struct Limit {
  double depth = std::numeric_limits<double>::infinity();       ///< [m] +inf: stable to the largest depth
  double frequency = std::numeric_limits<double>::quiet_NaN();  ///< [Hz] of the strongest chatter component
  Kind kind = Kind::none;
  /// [m] Change of the depth with a finer resolution; NaN without estimate_error.
  double error = std::numeric_limits<double>::quiet_NaN();
};

/// Dominant characteristic multiplier of one principal period (tooth period for even pitch, else revolution).
struct CharacteristicMultiplier {
  std::complex<double> value;
  double period = 0.0;  ///< [s]
  double radius() const { return std::abs(value); }
  Kind kind() const;
};

enum class Method { zero_order, multi_frequency, semi_discretization, collocation };
/// @throws Error naming the known ones.
Method methodOf(const std::string& name);
const char* nameOf(Method method);

/// Resolution of the solvers; 0 selects the default.
struct SolverOptions {
  int nodes = 0;                ///< collocation: Chebyshev nodes in an element (default 12), 4..40
  int steps = 0;                ///< semi_discretization: steps in a principal period (default 200)
  int order = 1;                ///< semi_discretization: interpolation order of the delayed term, 0..2
  int harmonics = 0;            ///< multi_frequency: tooth passing harmonics on each side (default 10)
  int lines = 0;                ///< multi_frequency: evenly spaced chatter frequencies (default 60)
  double tolerance = 1e-6;      ///< [1] relative, of the depth
  bool estimate_error = false;  ///< sets Limit::error from a refined solution
  /// collocation: optimises for thousands of multipliers. Matrices that depend only on the length of an
  /// element are taken from a table (relative error 1e-9) that costs as much as a few multipliers.
  bool many = false;

  /// For thousands of multipliers, in charts that are shown or drawn at random: 0.1 % of the depth.
  static SolverOptions ofManyPoints() {
    SolverOptions options;
    options.nodes = 8;
    options.tolerance = 1e-3;
    options.many = true;
    return options;
  }
};

/// A stability solver of one system.
class StabilitySolver {
 public:
  virtual ~StabilitySolver() = default;
  /// First loss of stability with growing depth. @param speed [rad/s] > 0 @param max_depth [m] > 0
  /// @throws Error on values out of range.
  virtual Limit limit(double speed, double max_depth) const = 0;
  /// The same at several speeds, between which a solver may share work.
  virtual std::vector<Limit> limits(const std::vector<double>& speeds, double max_depth) const;
};

/// A solver in the time domain, which provides the characteristic multipliers at any depth (Floquet).
class FloquetSolver : public StabilitySolver {
 public:
  /// The solver at one speed; caches results that do not depend on the depth, and may outlive its solver.
  class AtSpeed {
   public:
    virtual ~AtSpeed() = default;
    virtual CharacteristicMultiplier multiplier(double depth) = 0;
    /// [Hz] Strongest component of the tool motion that belongs to the dominant multiplier at a depth.
    virtual double chatterFrequency(double depth) = 0;
    /// Both at the cost of one.
    virtual std::pair<CharacteristicMultiplier, double> motion(double depth) {
      return {multiplier(depth), chatterFrequency(depth)};
    }
  };
  virtual std::unique_ptr<AtSpeed> at(double speed) const = 0;
  /// The same system at a finer resolution, for error estimates.
  virtual std::unique_ptr<FloquetSolver> refined() const = 0;

  /// @param speed [rad/s], depth [m] >= 0
  CharacteristicMultiplier multiplier(double speed, double depth) const;
  /// [m] First depth of a search from zero: a guess below the limits of all speeds.
  double firstDepth() const { return depth_scale_; }
  Limit limit(double speed, double max_depth) const override;
  /// Repeats the search where the limit at a neighbouring speed is much lower.
  std::vector<Limit> limits(const std::vector<double>& speeds, double max_depth) const override;

 protected:
  FloquetSolver(const RegenerativeSystem& system, const SolverOptions& options);
  RegenerativeSystem system_;
  SolverOptions options_;
  Limit describe(AtSpeed& here, double speed, double depth, double slope) const;
  double depth_scale_ = 0.0;  // [m] first depth of a search from zero
};

/// Method::collocation is the method of choice where modes are known: the structure is propagated exactly and
/// elements end where teeth enter and leave, so the error falls exponentially with the number of nodes.
/// @throws Error on an invalid system or options, and on dynamics that the method does not support.
std::unique_ptr<StabilitySolver> makeSolver(Method method, const RegenerativeSystem& system,
                                            const SolverOptions& options = {});
/// @throws Error as makeSolver(), and for methods in the frequency domain, which have no multipliers.
std::unique_ptr<FloquetSolver> makeFloquetSolver(Method method, const RegenerativeSystem& system,
                                                 const SolverOptions& options = {});

}  // namespace smartmill::stability
