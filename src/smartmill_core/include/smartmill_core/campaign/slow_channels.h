#pragma once

#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/strict_yaml.h"

namespace smartmill {

/// A channel of one test that was sampled at its own rate into its own file, for example the load that a
/// controller reports about ten times a second. An optional key of campaign.yaml (formats.md section 2).
struct SlowChannel {
  std::string test;
  std::string channel;  ///< load_meter
  std::string file;     ///< relative to the campaign's folder; columns time[s], on the record's clock, and it
  double sample_rate = 0.0;  ///< [Hz]
};

/// The file that a key of a map names. @throws Error on a file outside the campaign's folder.
std::string fileInside(const StrictYaml& map, const std::string& key);

/// The slow channels that campaign.yaml lists. @param tests of the campaign. @throws Error as readCampaign().
std::vector<SlowChannel> readSlowChannels(const StrictYaml& root, const std::vector<CampaignTest>& tests);
/// The same for a campaign in its folder.
std::vector<SlowChannel> readSlowChannels(const Campaign& campaign);

/// Samples of one slow channel. @throws Error as readRecord().
Record readRecord(const Campaign& campaign, const SlowChannel& channel);

/// Writes FOLDER/campaign.yaml with slow channels. @throws Error.
void writeCampaign(const Campaign& campaign, const std::vector<SlowChannel>& slow, const std::string& folder);

}  // namespace smartmill
