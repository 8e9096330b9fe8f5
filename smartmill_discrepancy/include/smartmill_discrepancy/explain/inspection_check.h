#pragma once

#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/io/inspection_file.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::discrepancy {

/// A measured dimension of a part next to what a model predicts, each as the deviation from nominal.
struct InspectedDimension {
  std::string test, kind, direction;
  double measured = 0.0, std_dev = 0.0;  ///< [m] at 20 deg C
  double before = 0.0, after = 0.0;      ///< [m] by the stated and by the improved model

  bool agreesBefore() const { return agrees(before); }
  bool agreesAfter() const { return agrees(after); }

 private:
  bool agrees(double predicted) const;  ///< within 1.96 standard deviations
};

struct InspectionCheck {
  std::vector<InspectedDimension> dimensions;
  std::vector<std::string> notes;  ///< dimensions that were not used, one line each

  std::string text() const;  ///< one line; empty without dimensions
};

/// Compares the dimensions of the campaign's cuts with two models; the forces of these cuts determined
/// neither dimension, so that they are independent evidence. A slot is as wide as the circle of the outermost
/// tooth (effects on the radius of tool and teeth); a face along z is lower by what the effects add to the
/// axial depth. Deflection of the tool is not included. The stated model's effects count as well.
InspectionCheck checkInspection(const InspectionFile& inspection, const std::vector<CampaignTest>& tests,
                                const MachineModel& stated, const MachineModel& improved);

}  // namespace smartmill::discrepancy
