#pragma once

#include <string>

#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_hammer/analysis/tap_records.h"

namespace smartmill::hammer {

std::string nameOf(ResponseKind kind);
/// Unit of an FRF with such a response.
std::string frfUnit(ResponseKind kind);
/// The receptance [m/N] of a motion; an FRF of a force [1] is unchanged.
FrequencyResponse receptanceOf(const FrequencyResponse& measured, ResponseKind kind);

}  // namespace smartmill::hammer
