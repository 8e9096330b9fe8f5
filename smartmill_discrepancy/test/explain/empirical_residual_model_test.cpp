// Causes outside the catalogue, added to the records: modelled if reproducible, otherwise left unexplained.
#include <cmath>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/io/text_file.h"
#include "smartmill_discrepancy/report/report_json.h"

#include "explain/hidden_cause_campaign.h"

namespace smartmill::discrepancy {
namespace {

// A tone with another phase in each record.
Record withTone(const CampaignTest& test, std::uint64_t seed, const char* channel, double frequency) {
  Record record = pure(test, 1.0, seed);
  std::vector<double>& f = record.add(channel);
  for (std::size_t i = 0; i < f.size(); ++i)
    f[i] += 5.0 * std::sin(units::TWO_PI * frequency * record.time[i] + 1.7 * static_cast<double>(seed));
  addNoise(record, seed);
  return record;
}

TEST(EmpiricalResidualModel, FindsATone) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) { return withTone(test, seed, "fx", 236.8); },
      folder.file("."), quickly());
  expectGapClosed(e);
  ASSERT_EQ(e.effects.size(), 1u);
  EXPECT_EQ(e.effects[0].name, "empirical:tone");
  EXPECT_EQ(e.effects[0].words.at("channel"), "fx");
  EXPECT_NEAR(valueOf(e.effects[0], "frequency_hz"), 236.8, 0.1);
  EXPECT_NEAR(valueOf(e.effects[0], "amplitude"), 5.0, 0.1);
  EXPECT_NE(e.sentence.find("contains a tone of"), std::string::npos) << e.sentence;

  writeReport(e, folder.file("."));
  const auto report = nlohmann::json::parse(readText(folder.file("report.json")));
  EXPECT_EQ(report["effects"][0]["name"], "empirical");
  EXPECT_EQ(report["effects"][0]["stage"], "channel");
  EXPECT_EQ(report["effects"][0]["form"], "tone");
  EXPECT_EQ(report["sentence"], e.sentence);
  EXPECT_GT(report["gap"]["without_empirical"]["heldout"], report["gap"]["after"]["heldout"]);
}

// Rigid forces are linear in the coefficients: the record is the sum of edge and chip forces.
TEST(EmpiricalResidualModel, FindsSofteningAfterEntry) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) {
        Record record = pure(test, 1.0, seed);
        const Record harder = pure(test, 2.0, seed);
        for (const char* c : FORCES_SHOWN) {
          std::vector<double>& f = record.add(c);
          for (std::size_t i = 0; i < f.size(); ++i)
            f[i] += 0.25 * std::exp(-(record.time[i] - 0.02) / 0.03) * (harder.column(c)[i] - f[i]);
        }
        addNoise(record, seed);
        return record;
      },
      folder.file("."), quickly());
  expectGapClosed(e);
  ASSERT_EQ(e.effects.size(), 1u);
  EXPECT_EQ(e.effects[0].name, "empirical:cutting_time");
  EXPECT_NEAR(valueOf(e.effects[0], "amplitude"), 0.25, 0.01);
  EXPECT_NEAR(valueOf(e.effects[0], "time_constant_s"), 0.03, 0.002);
}

// Another frequency in each record: not reproducible.
TEST(EmpiricalResidualModel, RejectsWhatIsNotReproducible) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) {
        return withTone(test, seed, "fy", 180.0 + 37.0 * static_cast<double>(seed * seed % 11));
      },
      folder.file("."), quickly());
  EXPECT_EQ(e.verdict, Verdict::unknown_effect);
  EXPECT_TRUE(e.effects.empty());
  EXPECT_TRUE(e.sentence.empty());
  EXPECT_FALSE(e.named_only);
}

}  // namespace
}  // namespace smartmill::discrepancy
