#include "smartmill_loadmeter/identification/campaign_identification.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

std::size_t firstInCut(const CampaignTest& test, const Record& record) {
  if (!test.engage_time) return 0;
  const double from = record.time.front() + *test.engage_time;
  const auto at = std::lower_bound(record.time.begin(), record.time.end(), from);
  return static_cast<std::size_t>(at - record.time.begin());
}

}  // namespace

IdentifiedCoefficients identifyFromForceRecords(const Campaign& campaign, const MachineModel& model,
                                                Means means) {
  const ToolGeometry& tool = model.needTool("identify cutting coefficients");
  std::vector<MeanForceTest> tests;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    const Record record = inFeedAxes(readRecord(campaign, test, model), test);
    std::size_t first = firstInCut(test, record);
    std::size_t count = record.size() - std::min(first, record.size());
    if (means == Means::revolutions) {
      const double turn = units::TWO_PI / test.spindle_speed * test.sample_rate;  // samples, not an integer
      const double turns = std::floor(static_cast<double>(count) / turn + 1e-9);
      if (turns < 1.0) throw Error(record.file + ": less than one revolution in cut");
      const std::size_t whole = static_cast<std::size_t>(std::lround(turns * turn));
      // The last ones, farthest from the transient of engagement. Without engagement the first ones.
      if (test.engage_time) first += count - whole;
      count = whole;
    }
    if (count == 0) throw Error(record.file + ": no samples after engage_time_s");
    MeanForceTest t;
    t.tool = tool;
    t.engagement = *test.engagement;
    const std::array<const char*, 3> names{"fx", "fy", "fz"};
    for (std::size_t a = 0; a < 3; ++a) {
      const std::vector<double>& force = record.column(names[a]);
      double sum = 0.0;
      for (std::size_t i = first; i < first + count; ++i) sum += force[i];
      t.force[a] = sum / static_cast<double>(count);
    }
    tests.push_back(t);
  }
  if (tests.empty()) throw Error(campaign.folder + ": no cut among the tests");
  return identifyFromForces(tests);
}

}  // namespace smartmill::loadmeter
