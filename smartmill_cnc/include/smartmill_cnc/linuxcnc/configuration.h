#pragma once

#include <map>
#include <string>

#include "smartmill_core/model/machine_model.h"

namespace smartmill::cnc::linuxcnc {

/// Names that the generated configuration and linuxcnc_stream share.
constexpr const char* PERMIT_SIGNAL = "permit";          ///< bit: the machine may move
constexpr const char* BEAT_SIGNAL = "beat";              ///< bit: changes while linuxcnc_stream lives
constexpr const char* LOAD_SIGNAL = "load";              ///< float: spindle load, 1 is full scale
constexpr const char* FEED_SIGNAL = "adaptive_feed";     ///< float: to motion.adaptive-feed (M52)
constexpr const char* SPINDLE_SIGNAL = "spindle_scale";  ///< float: factor on spindle.0.speed-out
constexpr const char* SAMPLER_PINS = "fffffffff";

/// A configuration of LinuxCNC for a machine without any hardware: ideal axes with the model's travel, rapid
/// and acceleration, a spindle that keeps the model's acceleration, turns to an angle (M19) and counts its
/// revolutions. The permit of linuxcnc_stream is its emergency stop chain. Of files by their names.
/// @param folder where they will stand @throws Error naming what the model lacks.
std::map<std::string, std::string> configurationOf(const MachineModel& model, const std::string& folder);

}  // namespace smartmill::cnc::linuxcnc
