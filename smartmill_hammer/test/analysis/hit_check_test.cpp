#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/modal/hit_check.h"
#include "smartmill_hammer_testing/hit_records.h"

namespace smartmill::hammer {
namespace {

// A sample of `rosrun smartmill_studies hammer_hit_gate`, with its own seeds. Required there: 99 % of clean
// hits accepted, 98 % of each fault rejected; in so small a sample one more may fail by chance.
TEST(HitCheck, AcceptsCleanHitsAndRejectsEachFault) {
  constexpr int RECORDS = 25, CHANCE = 2;
  for (int k = 0; k < HIT_CLASSES; ++k) {
    const auto kind = static_cast<HitClass>(k);
    const bool clean = kind == HitClass::clean || kind == HitClass::clean_group;
    int wrong = 0, hits = 0;
    for (std::uint64_t i = 0; i < RECORDS; ++i) {
      const HitCase drawn = drawHitCase(kind, 77000000 + i);
      HitCheckOptions options;
      options.weak_force = drawn.weak_force;
      options.high = drawn.high;
      const std::vector<HitFault> faults = checkHits(drawn.hits, options);
      for (std::size_t h = 0; h < faults.size(); ++h) {
        if (!clean && h != drawn.at_fault) continue;
        ++hits;
        wrong += faults[h].text.empty() != clean;
      }
    }
    EXPECT_LE(wrong, CHANCE) << nameOf(kind) << ": " << wrong << " of " << hits;
  }
}

}  // namespace
}  // namespace smartmill::hammer
