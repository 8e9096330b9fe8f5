#pragma once

#include "smartmill_core/command.h"

namespace smartmill::discrepancy {

/// Converts measurement files and recordings into a campaign.
Command campaignCommand();
/// Finds the effects that a model lacks, from a campaign or a recording.
Command explainCommand();
/// Prints the gap between measurement and twin, test by test.
Command gapCommand();

}  // namespace smartmill::discrepancy
