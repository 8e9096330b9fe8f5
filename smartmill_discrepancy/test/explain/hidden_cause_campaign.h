#pragma once

// Small campaigns with a cause added to the records, and expectations on their explanations.

#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"

#include "explain/small_campaign.h"

namespace smartmill::discrepancy {

inline const std::vector<const char*> FORCES_SHOWN{"fx", "fy", "fz"};

// The machine without a hidden cause and without noise; its chip coefficients times a factor.
inline Record pure(const CampaignTest& test, double chip_factor, std::uint64_t seed) {
  MachineModel machine = real();
  for (double CuttingCoefficients::*k :
       {&CuttingCoefficients::ktc, &CuttingCoefficients::krc, &CuttingCoefficients::kac})
    (*machine.cutting).*k *= chip_factor;
  sim::SimulationOptions options;
  options.substeps = 8;
  options.noise = false;
  options.seed = seed;
  return sim::simulateTest(machine, test, 0.1, options);
}

inline void addNoise(Record& record, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (const char* c : FORCES_SHOWN) {
    for (double& f : record.add(c)) f += normal(random);
  }
}

inline double valueOf(const FoundEffect& effect, const std::string& key) {
  for (const FoundParameter& p : effect.parameters) {
    if (p.key == key) return p.value;
  }
  ADD_FAILURE() << key;
  return 0.0;
}

// Effects of the catalogue are not under test here.
inline ExplainOptions quickly() {
  ExplainOptions options;
  options.search.max_effects = 1;
  options.search.fitted_per_round = 1;
  return options;
}

inline void expectGapClosed(const Explanation& e) {
  EXPECT_EQ(e.verdict, Verdict::unknown_effect);
  ASSERT_TRUE(e.named_only);
  EXPECT_LT(e.after.heldout, 0.5 * e.named_only->heldout);
  EXPECT_LT(e.after.heldout, 1.05);
  EXPECT_FALSE(e.unexplained.empty());  // empirical effects count as unexplained
  ASSERT_EQ(e.model.effects.size(), e.effects.size());
}

}  // namespace smartmill::discrepancy
