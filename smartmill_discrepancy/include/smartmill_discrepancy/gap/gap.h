#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// Gap of one channel of one test: RMS of (measured - simulated) over the channel's noise RMS; 1 is the noise
/// floor.
struct ChannelGap {
  std::string test;
  std::string channel;
  double gap = 0.0;           ///< [1]
  double residual_rms = 0.0;  ///< [unit of the channel]
};

struct CampaignGap {
  std::vector<ChannelGap> channels;
  /// [1] RMS over all samples and channels, each over its noise.
  double overall = 0.0;
};

/// Simulates every test of a campaign, held-out tests included, and compares it with its record.
/// @throws Error of the twin
CampaignGap campaignGap(const Dataset& data, const MachineModel& model, int threads = 1);

}  // namespace smartmill::discrepancy
