#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "node/parameters.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"
#include "smartmill_loadmeter/inspection/inspection_record.h"

namespace smartmill::loadmeter {

/// Options of the command `coefficients`.
struct CoefficientOptions {
  std::string program, source_path, source, servo_cuts, model, means = "all", output, database;
  NodeParameters parameters;
  std::string tool, material;
  double rake = NAN, depth_percent = 0.0, runout_um = 0.0;
  bool spindle_uncertainty = false, plain_friction = false, forces = false;
};

void printCoefficients(const CuttingCoefficients& value, const CuttingCoefficients& std_dev);
void printLoad(const CoefficientSet& found);
void printTerms(const CoefficientOptions& options, const LoadRecordResult& found);

/// Writes section cutting of a model file if a file is given. @throws Error when it cannot be written.
void writeSection(const std::string& file, const CuttingCoefficients& value,
                  const CuttingCoefficients& std_dev);

/// Adds an identification to the database if one is given.
void storeRecord(const CoefficientOptions& options, CoefficientRecord record);
/// Adds every cut of a bag.
void storeCuts(const CoefficientOptions& options, std::vector<CoefficientRecord> cuts);

/// Adds the accepted dimensions of parts in a bag; prints the reasons of the others.
void storeInspections(const CoefficientOptions& options, const MachineModel& model,
                      const std::vector<InspectionResult>& inspected);

/// Record with the mean conditions of a campaign's cuts.
CoefficientRecord recordOf(const Campaign& campaign, const MachineModel& model);

}  // namespace smartmill::loadmeter
