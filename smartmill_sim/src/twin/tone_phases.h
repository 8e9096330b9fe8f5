#pragma once

#include <random>

#include "smartmill_core/campaign/record.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/measuring_chain.h"

namespace smartmill::sim {

/// Sets the phases of the tones in a machine's signals. With a record they are estimated from the residual of
/// the twin without tones: joint least squares of sine and cosine over the channels of the tones, with their
/// means removed; clipped samples are ignored. Without a record they are drawn.
/// @param raw channels before the signal stage; nullptr: not simulated @param rate [Hz] @param speed [rad/s]
void findPhases(const Record* recorded, const ChannelRows& raw, double rate, double speed,
                const SignalStage& signals, std::mt19937_64& random);

}  // namespace smartmill::sim
