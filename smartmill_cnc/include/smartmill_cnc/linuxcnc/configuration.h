#pragma once

#include <map>
#include <string>

#include "smartmill_core/model/machine_model.h"

namespace smartmill::cnc::linuxcnc {

/// Names that the generated configuration and linuxcnc_stream share.
constexpr const char* PERMIT_SIGNAL = "permit";          ///< bit: motion is permitted
constexpr const char* BEAT_SIGNAL = "beat";              ///< bit: toggles while linuxcnc_stream runs
constexpr const char* LOAD_SIGNAL = "load";              ///< float: spindle load, 1 is full scale
constexpr const char* FEED_SIGNAL = "adaptive_feed";     ///< float: input of motion.adaptive-feed (M52)
constexpr const char* SPINDLE_SIGNAL = "spindle_scale";  ///< float: factor on spindle.0.speed-out
constexpr const char* SAMPLER_PINS = "fffffffff";

/// Configuration of a LinuxCNC without hardware: ideal axes with the model's travel, rapid feed and
/// acceleration; a spindle with the model's acceleration, orientation (M19) and a revolution counter. The
/// emergency stop chain depends on the permit of linuxcnc_stream. @param folder of the files @return text by
/// file name
/// @throws Error naming the missing value of the model.
std::map<std::string, std::string> configurationOf(const MachineModel& model, const std::string& folder);

}  // namespace smartmill::cnc::linuxcnc
