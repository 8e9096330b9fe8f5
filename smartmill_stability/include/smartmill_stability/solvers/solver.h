#pragma once

#include <array>
#include <complex>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::stability {

/// One vibration mode of the tool against the workpiece: q'' + 2 zeta w q' + w^2 q = input . F, and the tool
/// moves by output q. Unit 1/sqrt(kg) for both when q has unit modal mass. A mode in one axis has input and
/// output along that axis; cross terms are modes whose vectors have both components.
struct SystemMode {
  double frequency = 0.0;      ///< [Hz] > 0
  double damping_ratio = 0.0;  ///< [1] 0 < value < 1
  std::array<double, 2> input{{0.0, 0.0}};
  std::array<double, 2> output{{0.0, 0.0}};
};

enum class Cut { milling, turning };

/// What makes the chips of one tooth differ from another's: runout, a serrated edge, and, where pitch or
/// radius are uneven, the forced vibration itself. A tooth may then miss the cut at some place, and a later
/// one cuts what several left. The stability is that of the vibration about the forced one, with the contact
/// as it is there (chips grow with the feed, so with chip-proportional forces the ratio of offsets to feed
/// matters alone).
struct ChipGeometry {
  double feed = 0.0;                  ///< [m] per tooth (mean over the teeth) > 0
  std::vector<double> radius_offset;  ///< [m] runout of each tooth; empty: none
  double serration_amplitude =
      0.0;  ///< [m] >= 0, radius = amplitude x sin(2 pi (z / wavelength + k / teeth))
  double serration_wavelength = 0.0;  ///< [m] > 0 where there is an amplitude
  bool forced_vibration = true;       ///< false: chips of a rigid tool decide about the contact
};

/// A milling or turning system: dynamics of the tool tip and what regenerates. Angles are immersion angles,
/// clockwise from +y, x is the feed; forces act on the tool (docs/formats.md).
struct RegenerativeSystem {
  /// Dynamics: modes for every solver; receptances (measured or computed) for zero_order and multi_frequency,
  /// which fall back on the modes when it is empty.
  std::vector<SystemMode> modes;
  std::optional<ToolTipResponse> response;

  Cut cut = Cut::milling;
  int teeth = 1;              ///< 1..20
  std::vector<double> pitch;  ///< [rad] tooth k to tooth k + 1, sum 2 pi; empty: even
  double helix = 0.0;         ///< [rad] 0 <= helix < 80 deg; needs the diameter
  double diameter = 0.0;      ///< [m] of the tool (milling) or of the workpiece (turning)
  double entry = 0.0;         ///< [rad] milling; turning: the angle at which the edge stands all the time
  double exit = units::PI;    ///< [rad] > entry; unused in turning
  double kt = 0.0;            ///< [N/m2] tangential
  double kr = 0.0;            ///< [N/m2] radial
  /// Coefficients that change along the arc, tangential and radial [N/m2] at an immersion angle (a force law
  /// that is no straight line, about the chip there). Empty: kt and kr; else these tell the size alone. Known
  /// to the Floquet solvers, without a chip geometry.
  std::function<std::array<double, 2>(double angle)> along_arc;
  /// Process damping: a flank that moves into the material meets a force of coefficient x depth x velocity
  /// over cutting speed, velocity along the chip's normal. [N/m] >= 0
  double damping_tangential = 0.0;
  double damping_radial = 0.0;
  /// Share of the earlier surface that is cut again (Kim's mu): 1 milling and plunge turning, 0 threading.
  double overlap = 1.0;
  /// Milling: contact as it is. Absent: every tooth cuts all along its arc what the tooth before it left.
  /// Known to the Floquet solvers; zero_order knows the serration's mean over whole wavelengths.
  std::optional<ChipGeometry> chip;

  /// @throws Error naming the quantity and its value.
  void validate() const;
  bool evenPitch() const;
  double pitchOf(int tooth) const;  ///< [rad]
};

/// Modes of a receptance along one axis (0 x, 1 y), as SystemModes. @throws Error on a direct share: a
/// residual compliance has no inertia and would act at once.
std::vector<SystemMode> systemModes(const ModalModel& model, int axis);

/// Modes of x and y together.
std::vector<SystemMode> systemModes(const ModalModel& x, const ModalModel& y);

/// Receptance of the tool tip at f [Hz]: xx, xy, yx, yy [m/N].
std::array<std::complex<double>, 4> receptance(const std::vector<SystemMode>& modes, double f);

/// Receptances with cross terms, dense around each mode: lines from low to high [Hz].
ToolTipResponse responseOf(const std::vector<SystemMode>& modes, double low, double high, std::size_t lines);

/// How stability is lost: flip (period doubling: the vibration repeats every two tooth passages), Hopf
/// (quasi-periodic). fold, a multiplier at +1, belongs to static loss of stability.
enum class Kind { none, hopf, flip, fold };
const char* nameOf(Kind kind);

/// First loss of stability at one speed.
struct Limit {
  double depth = std::numeric_limits<double>::infinity();       ///< [m] +inf: stable to the largest asked for
  double frequency = std::numeric_limits<double>::quiet_NaN();  ///< [Hz] of the strongest chatter component
  Kind kind = Kind::none;
  /// [m] change of the depth when the resolution is raised; NaN where not asked for
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

/// Resolution of the solvers; 0 takes the default stated with it.
struct SolverOptions {
  int nodes = 0;                ///< collocation: Chebyshev nodes an element (default 12), 4..40
  int steps = 0;                ///< semi_discretization: intervals a principal period (default 200)
  int order = 1;                ///< semi_discretization: order of the delayed term's interpolation, 0..2
  int harmonics = 0;            ///< multi_frequency: tooth passing harmonics on each side (default 10)
  int lines = 0;                ///< multi_frequency: chatter frequencies tried a speed (default by damping)
  double tolerance = 1e-6;      ///< [1] of the depth, relative
  bool estimate_error = false;  ///< limits carry an error estimate from a refinement
  /// collocation: thousands of multipliers are due. What depends on an element's length alone then comes from
  /// a table (relative error 1e-9) that costs as much as a few of them.
  bool many = false;
};

/// A stability solver of one system.
class StabilitySolver {
 public:
  virtual ~StabilitySolver() = default;
  /// First loss of stability when the depth grows from zero. @param speed [rad/s] > 0
  /// @param max_depth [m] > 0. @throws Error.
  virtual Limit limit(double speed, double max_depth) const = 0;
  /// The same over speeds. Solvers that share work between speeds do it here.
  virtual std::vector<Limit> limits(const std::vector<double>& speeds, double max_depth) const;
};

/// A solver in the time domain, which knows the multipliers at any depth (Floquet).
class FloquetSolver : public StabilitySolver {
 public:
  /// Of one speed; remembers what does not depend on the depth, and may outlive its solver.
  class AtSpeed {
   public:
    virtual ~AtSpeed() = default;
    virtual CharacteristicMultiplier multiplier(double depth) = 0;
    /// [Hz] strongest component of the tool's motion in the dominant mode at a depth.
    virtual double chatterFrequency(double depth) = 0;
  };
  virtual std::unique_ptr<AtSpeed> at(double speed) const = 0;
  /// The same system at a higher resolution, for error estimates.
  virtual std::unique_ptr<FloquetSolver> refined() const = 0;

  /// @param speed [rad/s], depth [m] >= 0
  CharacteristicMultiplier multiplier(double speed, double depth) const;
  Limit limit(double speed, double max_depth) const override;
  /// Looks again where a neighbour's limit is much lower.
  std::vector<Limit> limits(const std::vector<double>& speeds, double max_depth) const override;

 protected:
  FloquetSolver(const RegenerativeSystem& system, const SolverOptions& options);
  RegenerativeSystem system_;
  SolverOptions options_;
  Limit describe(AtSpeed& here, double speed, double depth, double slope) const;
  double depth_scale_ = 0.0;  // [m] where a search from zero begins to look closely
};

/// The default where modes are known is Method::collocation: the structure is propagated exactly, elements
/// end where teeth enter and leave, so the error falls exponentially with the nodes at the least cost a
/// digit.
/// @throws Error on an impossible system or options, or a method that lacks its dynamics.
std::unique_ptr<StabilitySolver> makeSolver(Method method, const RegenerativeSystem& system,
                                            const SolverOptions& options = {});
/// @throws Error for methods in the frequency domain, which know no multipliers.
std::unique_ptr<FloquetSolver> makeFloquetSolver(Method method, const RegenerativeSystem& system,
                                                 const SolverOptions& options = {});

}  // namespace smartmill::stability
