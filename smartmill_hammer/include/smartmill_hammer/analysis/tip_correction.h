#pragma once

#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {
namespace hammer {

/// A value as far as it is known.
struct Known {
  double value = 0.0, std = 0.0;
};

/// The tool from the holder's face to its tip: a round beam with shear, its fluted part thinner.
struct ToolBeam {
  Known stickout;       ///< [m]
  Known diameter;       ///< [m] of the shank
  Known fluted_length;  ///< [m] from the tip
  Known flute_ratio{0.8,
                    0.04};      ///< [1] diameter of a round bar as stiff as the fluted part, over the shank's
  Known young{5.8e11, 2.0e10};  ///< [N/m2] cemented carbide, grades of 9..12 % cobalt
  Known density{14300.0, 300.0};  ///< [kg/m3]
};

/// Young's modulus and density of "carbide" or "steel". @throws Error on another word.
void setMaterial(ToolBeam& tool, const std::string& material);

/// What is believed of spindle and holder before anything is measured.
struct HolderPrior {
  /// [1/m] slope of a spindle mode at the tool tip over its deflection there: it turns about a point some 0.2
  /// m behind. Seen apart from the gain only by hits at two heights.
  Known tilt{4.0, 5.0};
  /// Tool against holder: the compliance of its seat is one deviation at these stiffnesses, and may be none.
  double across = 1.0e8;   ///< [N/m]
  double turning = 1.0e5;  ///< [N m/rad] of a tool of 12 mm; it grows with the cube of the diameter
  double height = 0.0;     ///< [m] one deviation by which all heights above the tip may be off together
};

/// One measurement: where the hammer struck and the sensor read, above the tip, and what was found.
struct OffsetMeasurement {
  double struck = 0.0, read = 0.0;  ///< [m]
  ModalModel modes;                 ///< [m/N] of the FRF from struck to read
  double scale_std = 0.0;           ///< [1] of what is common to its gains; their deviations are without it
};

/// A mode as it is at the tip.
struct TipMode {
  Mode direct;              ///< struck and read at the tip
  double added = 0.0;       ///< [m/N] direct gain less what the measurement holds of it
  double factor = 1.0;      ///< direct over measured gain (of the first measurement)
  double factor_std = 0.0;  ///< what the correction does not know
  bool seen = true;         ///< false: the hammer stood at its node, the beam tells of it
};

struct TipCorrection {
  std::vector<TipMode> modes;   ///< lowest frequency first
  std::vector<TipMode> beyond;  ///< above the band, as far as the beam tells: what they add counts inside it
  double direct = 0.0;          ///< [m/N] static share at the tip of all above the band
  double direct_std = 0.0;      ///< [m/N]

  ModalModel model() const;
};

/// The direct receptance at the tip from one struck and read elsewhere (Dunwoody 4.4), spindle and tool modes
/// apart. The tool is a beam (finite elements with shear) held by springs in spindle and holder, whose modes
/// move its end across and turn it; all that is not known (beam, springs, the spindle modes' tilt) has a
/// prior, and is fitted to the frequencies and gains measured. Eq. 4.44 in place of it takes every mode for
/// one of the tool's, bent quasi-statically. A second measurement at another height tells the tilt.
/// @param measurements of one tool in one direction, with the same modes in each (frequencies from the first;
/// a further one may lack some)
/// @param high [Hz] modes are due up to here
/// @throws Error on heights beyond the stick-out, no mode, or a beam that is none
TipCorrection correctToTip(const std::vector<OffsetMeasurement>& measurements, const ToolBeam& tool,
                           const HolderPrior& prior, double high);

/// The same where nothing is known of the tool's material: modes above the band, of which only the beam
/// tells, add nothing but their share to the standard deviations.
TipCorrection withoutBeyond(TipCorrection correction);

/// The measured FRF [m/N] turned into the tip's: what the modes gain is added line by line. Standard
/// deviations of lines include that of the correction.
FrequencyResponse tipResponse(const FrequencyResponse& measured, const TipCorrection& correction);

}  // namespace hammer
}  // namespace smartmill
