#include "smartmill_core/campaign/slow_channels.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "smartmill_core/error.h"

namespace smartmill {

namespace {

constexpr const char* KEY = "slow_channels";

SlowChannel readOne(const StrictYaml& map, const std::vector<CampaignTest>& tests) {
  SlowChannel slow;
  slow.test = map.word("test");
  slow.channel = map.oneOf("channel", {"load_meter"});
  slow.file = fileInside(map, "file");
  slow.sample_rate = map.number("sample_rate_hz", Range::positive());
  map.finish();
  const auto test =
      std::find_if(tests.begin(), tests.end(), [&](const CampaignTest& t) { return t.name == slow.test; });
  if (test == tests.end()) map.fail("test", "'" + slow.test + "' is not a test of the campaign");
  if (test->kind == TestKind::tap) map.fail("test", "'" + slow.test + "' is a tap, without spindle rotation");
  return slow;
}

}  // namespace

std::vector<SlowChannel> readSlowChannels(const StrictYaml& root, const std::vector<CampaignTest>& tests) {
  std::vector<SlowChannel> all;
  if (!root.has(KEY)) return all;
  for (const StrictYaml& map : root.maps(KEY)) {
    all.push_back(readOne(map, tests));
    const SlowChannel& slow = all.back();
    const auto same = std::count_if(all.begin(), all.end(), [&](const SlowChannel& other) {
      return other.test == slow.test && other.channel == slow.channel;
    });
    if (same > 1) map.fail("channel", slow.channel + " of '" + slow.test + "' occurs twice");
  }
  return all;
}

std::vector<SlowChannel> readSlowChannels(const Campaign& campaign) {
  const std::string file = (std::filesystem::path(campaign.folder) / "campaign.yaml").string();
  if (!std::filesystem::exists(file)) return {};  // campaign that exists only in memory
  return readSlowChannels(StrictYaml::fromFile(file), campaign.tests);
}

Record readRecord(const Campaign& campaign, const SlowChannel& slow) {
  CampaignTest as_test;
  as_test.file = slow.file;
  as_test.sample_rate = slow.sample_rate;
  Record record = readRecord(campaign, as_test);
  record.column(slow.channel);  // throws if missing
  return record;
}

void writeCampaign(const Campaign& campaign, const std::vector<SlowChannel>& slow,
                   const std::string& folder) {
  writeCampaign(campaign, folder);
  if (slow.empty()) return;
  const std::string file = (std::filesystem::path(folder) / "campaign.yaml").string();
  std::ofstream out(file, std::ios::app);
  out << KEY << ":\n";
  for (const SlowChannel& s : slow) {
    out << "- test: " << yamlWord(s.test) << "\n  channel: " << s.channel << "\n  file: " << yamlWord(s.file)
        << "\n  sample_rate_hz: " << yamlNumber(s.sample_rate) << "\n";
  }
  out.close();
  if (!out) throw Error(file + ": cannot be written");
}

}  // namespace smartmill
