#pragma once

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/measuring_chain.h"

namespace smartmill::sim {

/// Sets the zeros of a machine's signals to the mean difference between a record and the twin without them:
/// of a cut before its engagement, of other tests over the whole record. 0 without a record, and for a cut
/// that has no such part. @param raw channels before the signal stage; nullptr: not simulated
void findZeros(const CampaignTest& test, const Record* recorded, const ChannelRows& raw,
               const SignalStage& signals);

}  // namespace smartmill::sim
