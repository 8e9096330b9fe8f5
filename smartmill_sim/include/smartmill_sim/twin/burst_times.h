#pragma once

#include <random>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/effect.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/measuring_chain.h"

namespace smartmill::sim {

/// Sets the begin of the burst trains in a machine's signals. With a record it is estimated from the residual
/// of the twin without bursts: matched filter over the residual folded at the period of the train. Without a
/// record it is drawn.
/// @param raw channels before the signal stage; nullptr: not simulated @param rate [Hz]
void findBursts(const Record* recorded, const ChannelRows& raw, double rate, const SignalStage& signals,
                std::mt19937_64& random);

}  // namespace smartmill::sim
