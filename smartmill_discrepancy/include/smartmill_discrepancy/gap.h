#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/model/machine_model.h"

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
  std::map<std::string, double> noise;  ///< [unit of the channel]
  /// [1] RMS over all samples and channels, each over its noise.
  double overall = 0.0;
};

/// Simulates every test and compares it with its record. Channels that count: fx, fy, fz, load_meter. The
/// noise is the model's noise_rms_n where stated, else estimated from the parts of the records without
/// cutting.
/// @param progress called with the name of each test before it is simulated
/// @throws Error also when no noise estimate is possible, naming the channel.
CampaignGap campaignGap(const Campaign& campaign, const MachineModel& model,
                        const std::function<void(const std::string&)>& progress = {});

}  // namespace smartmill::discrepancy
