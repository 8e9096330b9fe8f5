#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill::hammer {

/// A value with its standard deviation.
struct UncertainValue {
  double value = 0.0, std = 0.0;
};

/// The tool from the holder's face to its tip: a round beam with shear, thinner where it is fluted.
struct ToolBeam {
  UncertainValue stickout;       ///< [m]
  UncertainValue diameter;       ///< [m] of the shank
  UncertainValue fluted_length;  ///< [m] from the tip
  /// [1] diameter of a round bar of the same bending stiffness as the flutes, over the shank's
  UncertainValue flute_ratio{0.8, 0.04};
  UncertainValue young{5.8e11, 2.0e10};    ///< [N/m2] cemented carbide, grades of 9..12 % cobalt
  UncertainValue density{14300.0, 300.0};  ///< [kg/m3]
};

/// Young's modulus and density of "carbide" or "steel". @throws Error on another word.
void setMaterial(ToolBeam& tool, const std::string& material);

/// Prior knowledge of spindle and holder.
struct HolderPrior {
  /// [1/m] slope of a spindle mode at the tool tip over its deflection there: it rotates about a point some
  /// 0.2 m above. Separable from the gain only by hits at two heights.
  UncertainValue tilt{4.0, 5.0};
  /// Stiffness of the tool's seat in the holder whose compliance is one standard deviation of the prior.
  double lateral_stiffness = 1.0e8;  ///< [N/m]
  double rotational_stiffness =
      1.0e5;            ///< [N m/rad] of a tool of 12 mm; proportional to the cube of the diameter
  double height = 0.0;  ///< [m] standard deviation of an error common to all heights above the tip
};

/// How the beam is fitted, and how far it is trusted.
struct TipFitOptions {
  // Model error of the beam; the study hammer_offset counts the coverage of the standard deviations.
  double model_ratio = 0.005;     ///< [1] of the ratio of the gains at two heights
  double model_factor = 0.025;    ///< [1] of (a factor to the tip - 1)
  double model_frequency = 0.01;  ///< [1]
  double model_gain = 0.03;       ///< [1] of a gain
  double model_small = 0.003;     ///< [1] of a gain, over the largest, for the weak modes next to strong ones
  /// [1] Standard deviation of the measured gain of a mode that is not measured, over the largest gain: a
  /// mode as strong would have been found.
  double largest_unmeasured = 0.03;

  /// [1] Range of the frequency of a tool mode, over that of the clamped tool: the holder is softer, a
  /// spindle mode nearby pushes it up.
  double tool_low = 0.35, tool_high = 1.5;
  std::size_t most_tool_modes = 2;  ///< in the band; the third bending mode of a tool is far above

  /// [std] Compliance of the seat that counts as rigid, and at the start of the fit.
  double rigid_seat = 0.01, seat_start = 0.3;
  double seat_diameter = 0.012;  ///< [m] of the tool to which the prior of the seat belongs
  /// [1] Prior of a spindle mode without the tool: its spread about the measured one, logarithmic. Wide,
  /// since the mass and the modes of the tool shift it.
  double frequency_spread = 0.4, gain_spread = 2.0;
  double unknown_bound = 6.0;  ///< [std] of an unknown: beyond it the prior is wrong
  int rounds = 3;       ///< in which the modes are matched anew; the fit ends earlier once the match stays
  int iterations = 40;  ///< of least squares in a round, bounds its time
  /// [1] Relative, of the damping of a mode that is not measured, about the median of the others.
  double predicted_damping_std = 0.5;
};

/// Modes of one FRF, struck and measured at heights above the tip.
struct OffsetMeasurement {
  double struck = 0.0, read = 0.0;  ///< [m]
  ModalModel modes;                 ///< [m/N]
  double scale_std = 0.0;           ///< [1] standard deviation common to all gains, not contained in theirs
};

/// A mode at the tip.
struct TipMode {
  Mode direct;              ///< struck and measured at the tip
  double added = 0.0;       ///< [m/N] direct gain minus measured gain
  double factor = 1.0;      ///< [1] direct over measured gain (of the first measurement)
  double factor_std = 0.0;  ///< [1]
  bool measured = true;     ///< false: struck at its node, predicted by the beam
};

struct TipCorrection {
  std::vector<TipMode> modes;   ///< lowest frequency first
  std::vector<TipMode> beyond;  ///< predicted above the band; their `added` contributes inside it
  double direct = 0.0;          ///< [m/N] static contribution at the tip of all modes above the band
  double direct_std = 0.0;      ///< [m/N]

  ModalModel model() const;
};

/// The direct receptance at the tip from one struck and measured elsewhere (Dunwoody 4.4), with spindle and
/// tool modes apart. The tool is a beam (finite elements with shear) held by springs in spindle and holder,
/// whose modes displace and rotate its end. Unknown values (beam, springs, tilt of the spindle modes) have a
/// prior and are fitted to the measured frequencies and gains. Eq. 4.44, in contrast, treats every mode as a
/// quasi-static bending of the tool. A second measurement at another height determines the tilt.
/// @param measurements of one tool in one direction, with the same modes (frequencies from the first; a
/// further one may lack some)
/// @param high [Hz] upper end of the band in which all modes are expected to be measured
/// @throws Error on heights beyond the stick-out, no mode, or invalid values of the beam
TipCorrection correctToTip(const std::vector<OffsetMeasurement>& measurements, const ToolBeam& tool,
                           const HolderPrior& prior, double high, const TipFitOptions& options = {});

/// For an unknown tool material: modes above the band, which only the beam predicts, contribute to the
/// standard deviations alone.
TipCorrection withoutBeyond(TipCorrection correction);

/// The FRF [m/N] at the tip: the measured one plus the added gains of the modes, line by line. The standard
/// deviations of lines include that of the correction.
FrequencyResponse tipResponse(const FrequencyResponse& measured, const TipCorrection& correction);

}  // namespace smartmill::hammer
