#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"

namespace smartmill::discrepancy {

/// A cause that the catalogue does not list.
struct OutsideCause {
  std::string kind;            ///< tone, level, order, settling
  std::string channel;         ///< fx, fy, fz
  double amplitude = 0.0;      ///< [N]
  double place = 0.0;          ///< [Hz], order, or time constant [s]
  std::string domain() const;  ///< where a report should see it
};

/// What a campaign of the bench hides.
struct BenchTruth {
  MachineModel machine;  ///< what is really there, effects included
  std::optional<OutsideCause> outside;
};

/// A random end mill with sensor and spindle; flexible: with modes of the tool tip.
MachineModel drawMachine(std::mt19937_64& random, bool flexible);

/// The same with every value off by its stated uncertainty.
MachineModel drawTruth(const MachineModel& nominal, std::mt19937_64& random);

OutsideCause drawOutside(std::mt19937_64& random);

/// Writes a campaign of 21 tests (air cuts, taps, slots over feed, speed and depth, up- and down-milling)
/// into a folder. The records come from the process of cut surfaces in fine steps, not from the tables that
/// explain uses for rigid tools; phase and noise are drawn.
/// @throws Error.
void writeBenchCampaign(const MachineModel& nominal, const BenchTruth& truth, const std::string& folder,
                        std::uint64_t seed, int substeps);

}  // namespace smartmill::discrepancy
