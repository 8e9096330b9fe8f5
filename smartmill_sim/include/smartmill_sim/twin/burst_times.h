#pragma once

#include <random>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/effect.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/measuring_chain.h"

namespace smartmill::sim {

struct BurstSearch {
  double bins_per_cycle = 24.0;  ///< of the folded residual, per period of the burst's oscillation
  double most_bins = 8192.0;     ///< bounds the time of the search
  double decays = 5.0;           ///< [decay times] length of the burst's template: e^-5 remains
};

/// Sets the begin of the burst trains in a machine's signals. With a record it is estimated from the residual
/// of the twin without bursts: matched filter over the residual folded at the period of the train. Without a
/// record it is drawn.
/// @param raw channels before the signal stage; nullptr: not simulated @param rate [Hz]
void findBursts(const Record* recorded, const ChannelRows& raw, double rate, const SignalStage& signals,
                std::mt19937_64& random, const BurstSearch& search = {});

}  // namespace smartmill::sim
