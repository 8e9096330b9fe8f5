#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "node/parameters.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"

namespace smartmill::loadmeter {

/// Where coefficients are identified from, and what becomes of them.
struct CoefficientOptions {
  std::string program, source_path, source, model, means = "all", output, database;
  NodeParameters parameters;
  std::string tool, material;
  double rake = NAN, depth_percent = 0.0, runout_um = 0.0;
  bool spindle_uncertainty = false, plain_friction = false, forces = false;
};

void printCoefficients(const CuttingCoefficients& value, const CuttingCoefficients& std_dev);
void printLoad(const CoefficientSet& found);
void printTerms(const CoefficientOptions& options, const LoadRecordResult& found);

/// A model file's section cutting, where a file is named. @throws Error if it cannot be written.
void writeSection(const std::string& file, const CuttingCoefficients& value,
                  const CuttingCoefficients& std_dev);

/// Adds an identification to the database, where one is named.
void keepRecord(const CoefficientOptions& options, CoefficientRecord record);
/// Adds every cut of a bag.
void keepCuts(const CoefficientOptions& options, std::vector<CoefficientRecord> cuts);

/// Means over the cuts of a campaign.
CoefficientRecord recordOf(const Campaign& campaign, const MachineModel& model);

}  // namespace smartmill::loadmeter
