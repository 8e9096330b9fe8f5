#pragma once

#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/strict_yaml.h"

namespace smartmill {

/// A channel of one test that was read at a rate of its own, into a file of its own: the load that a
/// controller tells some ten times a second. An optional key of campaign.yaml (formats.md section 2).
struct SlowChannel {
  std::string test;
  std::string channel;  ///< load_meter
  std::string file;     ///< relative to the campaign's folder; columns time[s], on the record's clock, and it
  double sample_rate = 0.0;  ///< [Hz]
};

/// The key `file` of a map. @throws Error on a file outside the campaign's folder.
std::string fileInside(const StrictYaml& map);

/// Those that a campaign.yaml names. @param tests that it may speak of. @throws Error as readCampaign().
std::vector<SlowChannel> readSlowChannels(const StrictYaml& root, const std::vector<CampaignTest>& tests);
/// The same of a campaign in its folder.
std::vector<SlowChannel> readSlowChannels(const Campaign& campaign);

/// Readings of one. @throws Error as readRecord().
Record readRecord(const Campaign& campaign, const SlowChannel& channel);

/// Writes FOLDER/campaign.yaml with them. @throws Error.
void writeCampaign(const Campaign& campaign, const std::vector<SlowChannel>& slow, const std::string& folder);

}  // namespace smartmill
