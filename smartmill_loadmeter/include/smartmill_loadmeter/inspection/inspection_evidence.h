#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_loadmeter/database/shop_records.h"
#include "smartmill_loadmeter/inspection/inspection_parameters.h"

namespace smartmill::loadmeter {

/// Effective radius of a tool from the widths of its slots. A slot is as wide as the circle of the outermost
/// tooth, so that runout is part of it.
struct RadiusEvidence {
  std::string machine, tool;
  double diameter = 0.0;           ///< [m] stated
  Estimate deviation;              ///< [m] of the effective radius from the stated one; negative: worn
  std::size_t used = 0;            ///< widths
  std::size_t corrected = 0;       ///< of these with a known deflection of the tool
  std::vector<std::string> notes;  ///< one line each: refused widths, scatter
  std::string problem;             ///< why there is no estimate; empty: there is one

  std::string text() const;  ///< one line
};

/// Thermal growth of a machine along an axis, from the positions of faces that one tool cut at several
/// temperatures: position - nominal = offset + coefficient (T - mean T). The temperature is that of the
/// spindle motor for z and of the axis' servo motor for x and y; the offset contains datum and tool length.
struct GrowthEvidence {
  std::string machine, tool, axis;
  Estimate coefficient;  ///< [m/K] positive: faces move in the positive direction as it warms up
  double lowest = 0.0, highest = 0.0;  ///< [K] of the positions used
  std::size_t used = 0;
  std::vector<std::string> notes;
  std::string problem;

  std::string text() const;
};

struct InspectionEvidence {
  std::vector<RadiusEvidence> radii;
  std::vector<GrowthEvidence> growths;

  std::vector<std::string> lines() const;  ///< each estimate, followed by its notes
};

/// Evidence of each tool. Weights are the inverse variances; of a radius the uncertainty of the corrections
/// for deflection is common to all widths, of a growth the uncertainty of the temperature adds growth x
/// temperature_std to each position. Outliers and sets that disagree: weighted_fit.h.
InspectionEvidence inspectionEvidence(const std::vector<InspectionRecord>& records,
                                      const InspectionParameters& parameters = {});

}  // namespace smartmill::loadmeter
