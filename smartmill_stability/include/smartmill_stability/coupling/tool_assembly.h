#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_stability/coupling/beam.h"
#include "smartmill_stability/coupling/spindle.h"

namespace smartmill::stability {

/// An end mill outside its holder.
struct ToolDescription {
  std::string name;
  double stickout = 0.0;       ///< [m] > 0 from the holder's face to the tip
  double diameter = 0.0;       ///< [m] > 0 of shank and flutes
  double fluted_length = 0.0;  ///< [m] 0 .. stickout, from the tip
  int teeth = 0;
  double helix = 0.0;  ///< [rad]
  /// [1] Diameter of the round bar that bends as the fluted part, over the diameter: 0.8 (Kops and Vo, Annals
  /// of the CIRP 39, 1990).
  double flute_ratio = 0.8;
  BeamMaterial material;

  void validate() const;  ///< @throws Error naming tool and quantity
  /// From the tip to the holder's face. @param flute_factor [1] on flute_ratio
  std::vector<BeamSegment> segments(double flute_factor = 1.0) const;
};

/// Unknowns of an assembly, natural logarithms.
enum ContactUnknown {
  translation,
  rotation,
  translation_damping,
  rotation_damping,
  flutes,
  contact_unknowns
};
using ContactVector = Eigen::Matrix<double, contact_unknowns, 1>;
using ContactMatrix = Eigen::Matrix<double, contact_unknowns, contact_unknowns>;

/// Flexible joint of the tool's shank with the holder at the holder's face: stiffness [N/m], [N m/rad],
/// viscous damping [N s/m], [N m s/rad] (Park, Altintas and Movahhedy 2003), and a factor on the flute ratio,
/// with the covariance of their logarithms.
struct ContactEstimate {
  ContactVector log_value;
  ContactMatrix covariance;
  /// Before any tapped tool: an interference or collet fit of a 6 .. 25 mm shank, 5e7 N/m and 2e5 N m/rad
  /// within a factor of 7.
  static ContactEstimate prior();
  /// For another tool in the same holder, whose flutes are unknown. @param scatter [1] standard deviation of
  /// log stiffness and damping from tool to tool
  ContactEstimate forAnotherTool(double scatter) const;
  double value(ContactUnknown which) const;
  Receptance compliance(double f) const;  ///< at f [Hz]
};

/// A tool and its measured tip FRF [m/N].
struct TappedTool {
  ToolDescription tool;
  FrequencyResponse tip;
};

/// The largest peak of a tip FRF.
struct TipPeak {
  double frequency = 0.0;    ///< [Hz]
  double flexibility = 0.0;  ///< [m/N] magnitude
  double damping = 0.0;      ///< [1] half-power bandwidth over twice the frequency
};
TipPeak tipPeak(const FrequencyResponse& tip);
/// Of the peaks with at least a share of the largest, the one nearest to a frequency [Hz]: the same mode in
/// another FRF of the tool.
TipPeak tipPeak(const FrequencyResponse& tip, double near, double least_share);

/// Tip FRF of a tool that was not tapped.
struct TipPrediction {
  FrequencyResponse tip;  ///< with standard deviations
  TipPeak peak;
  double frequency_std = 0.0, flexibility_std = 0.0, damping_std = 0.0;  ///< [Hz], [m/N], [1] of the peak
};

struct AssemblyOptions {
  double contact_scatter = 0.2;  ///< [1] of the joint from tool to tool
  /// [1] Standard deviations that no tap of another tool determines: of the measured receptances of the
  /// spindle, and of the stiffness of a tool (material, flutes).
  double spindle_error = 0.02, tool_error = 0.02;
  int draws = 40;
  unsigned seed = 1;
};

/// A spindle with its holder, in one direction.
class ToolAssembly {
 public:
  /// @param holder from its face to the flange of the spindle, with the shank as core; empty: the spindle's
  /// receptances are those at the face. @throws Error on invalid segments.
  ToolAssembly(const SpindleReceptances& spindle, const std::vector<BeamSegment>& holder,
               const AssemblyOptions& options = {});

  /// @throws Error on an invalid tool.
  FrequencyResponse tip(const ToolDescription& tool, const ContactEstimate& contact) const;
  /// Contact from tapped tools that share it, with the flutes of each (those of the first are returned), by
  /// least squares on the relative difference of the FRFs about a prior; the covariance follows from the
  /// misfit. @throws Error when the fit fails.
  ContactEstimate fit(const std::vector<TappedTool>& tapped, const ContactEstimate& prior) const;
  /// Prediction with the standard deviations of the contact, of the spindle and of the tool.
  TipPrediction predict(const ToolDescription& tool, const ContactEstimate& contact) const;

 private:
  std::vector<double> frequency_;
  std::vector<Receptance> back_;  // at the holder's face
  AssemblyOptions options_;
};

/// Modes of a predicted tip FRF, with the relative standard deviations of its peak.
ModalModel modesOf(const TipPrediction& prediction);

}  // namespace smartmill::stability
