#pragma once

#include "smartmill_core/command.h"

namespace smartmill::discrepancy {

/// Measurement files and recordings become a campaign.
Command campaignCommand();
/// Which effects a model lacks, from a campaign or a recorded session.
Command explainCommand();
/// How far measurement and twin are apart, test by test.
Command gapCommand();

}  // namespace smartmill::discrepancy
