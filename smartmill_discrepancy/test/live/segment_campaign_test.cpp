#include "smartmill_discrepancy/live/segment_campaign.h"

#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

using units::MM;
using units::PI;

RecordSegment segment(const std::string& name, double start, double speed) {
  RecordSegment s;
  s.test.name = name;
  s.test.kind = TestKind::air;
  s.test.sample_rate = 1000.0;
  s.test.spindle_speed = speed;
  s.test.start_time = start;
  s.record.time = {0.0, 1e-3, 2e-3};
  for (const char* c : {"fx", "fy", "fz"}) s.record.add(c) = {0.0, 1.0, 2.0};
  return s;
}

RecordSegment cut(const std::string& name, double start, Engagement engagement, double direction = 0.0) {
  RecordSegment s = segment(name, start, 400.0);
  s.test.kind = TestKind::cut;
  s.test.engagement = engagement;
  s.test.feed_direction = direction;
  return s;
}

struct Written {
  std::size_t tests = 0;
  Campaign campaign;
  std::vector<std::string> lines;
  std::set<std::string> names;
};

Written write(const std::vector<RecordSegment>& segments) {
  MachineModel model = smartmill::mill();
  model.force_sensor.noise_rms.reset();  // the stability limit is not evaluated
  SegmentCampaign campaign;
  for (const RecordSegment& s : segments) campaign.add(s);
  const TemporaryFolder folder;
  Written w;
  w.tests = campaign.write(model, LiveGapOptions(), folder.file("campaign"),
                           [&](const std::string& line) { w.lines.push_back(line); });
  w.campaign = readCampaign(folder.file("campaign"));
  for (const CampaignTest& t : w.campaign.tests) w.names.insert(t.name);
  return w;
}

const Engagement SLOT{0.0, PI, MM, 0.1 * MM};

// A production of one pocket: many equal cuts and a few others. All of the others are kept.
TEST(SegmentCampaign, keepsTheCutsThatDifferMostInOrderOfTime) {
  std::vector<RecordSegment> all;
  for (int k = 0; k < 60; ++k) {
    const double start = 2.0 * k;
    if (k == 7) {
      all.push_back(cut("fast_feed", start, {0.0, PI, MM, 0.2 * MM}));
    } else if (k == 20) {
      all.push_back(cut("deep", start, {0.0, PI, 3.0 * MM, 0.1 * MM}));
    } else if (k == 33) {
      all.push_back(cut("half", start, {0.5 * PI, PI, MM, 0.1 * MM}));
    } else if (k == 45) {
      all.push_back(cut("across", start, SLOT, 0.5 * PI));
    } else {
      all.push_back(cut("slot" + std::to_string(k), start, SLOT));
    }
    if (k % 6 == 0) all.push_back(segment("air" + std::to_string(k), start + 1.0, k == 30 ? 800.0 : 400.0));
  }
  const Written w = write(all);
  EXPECT_EQ(w.tests, SegmentCampaign::MOST_CUTS + SegmentCampaign::MOST_AIR);
  EXPECT_EQ(w.campaign.tests.size(), w.tests);
  // The first and the last slot: what changes in time needs both.
  for (const char* name : {"fast_feed", "deep", "half", "across", "slot0", "slot59", "air30", "air54"})
    EXPECT_EQ(w.names.count(name), 1u) << name;
  for (std::size_t k = 1; k < w.campaign.tests.size(); ++k)
    EXPECT_LT(*w.campaign.tests[k - 1].start_time, *w.campaign.tests[k].start_time);
  EXPECT_EQ(w.lines, (std::vector<std::string>{"12 of 60 cuts: those that differ most",
                                               "3 of 10 air cuts: those that differ most"}));
}

TEST(SegmentCampaign, keepsAllOfFewAndTheLastOfACondition) {
  const Written w = write({cut("a", 1.0, SLOT), cut("b", 2.0, SLOT), cut("a", 3.0, SLOT)});
  EXPECT_EQ(w.tests, 2u);
  EXPECT_TRUE(w.lines.empty());
  EXPECT_EQ(w.names, (std::set<std::string>{"a", "b"}));
  EXPECT_EQ(*w.campaign.tests.at(0).start_time, 3.0);
}

}  // namespace
}  // namespace smartmill::discrepancy
