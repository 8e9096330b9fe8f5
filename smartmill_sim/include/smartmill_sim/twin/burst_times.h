#pragma once

#include <array>
#include <random>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/effect.h"
#include "smartmill_sim/twin/cutting_machine.h"

namespace smartmill::sim {

/// Sets when the bursts of a machine's signals begin: where a record shows them best beyond what the twin
/// shows without them, by the matched filter over the record folded at their period; without a record drawn.
/// @param early of each channel, before the signal stage; nullptr: not shown @param rate [Hz]
void findBursts(const Record* recorded, const std::array<std::vector<double>*, CHANNEL_COUNT>& early,
                double rate, CuttingMachine& machine, std::mt19937_64& random);

}  // namespace smartmill::sim
