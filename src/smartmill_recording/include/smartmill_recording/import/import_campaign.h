#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_recording/import/import_plan.h"

namespace smartmill::recording {

/// What an import did, or why it did not.
struct ImportResult {
  std::vector<std::string> report;  ///< "FILE: fx from channel Fx [N]", one line each
  std::vector<std::string> faults;  ///< "FILE: what is missing or wrong"; empty: the campaign was written
};

/// Makes a campaign of the steady cuts of a bag, an MCAP file or a campaign with tests of kind path.
/// @throws Error
using RecordingImport = std::function<Campaign(const std::string& source, const std::string& model_file,
                                               const std::string& folder)>;

/// Writes FOLDER/campaign.yaml, model.yaml and one CSV (nine significant digits) per test: a file of channels
/// is one test, a campaign brings its tests. All faults of all files are collected; with any fault nothing is
/// written.
/// @param folder absent or empty @param recordings of bags, MCAP files and tests of kind path; none: those
/// are faults
/// @throws Error where the folder cannot be used or written.
ImportResult importCampaign(const ImportPlan& plan, const std::vector<std::string>& files,
                            const std::string& folder, const RecordingImport& recordings = {});

}  // namespace smartmill::recording
