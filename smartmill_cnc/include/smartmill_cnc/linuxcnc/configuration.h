#pragma once

#include <map>
#include <string>

#include "smartmill_cnc/linuxcnc/liveness.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::cnc::linuxcnc {

/// Names that the generated configuration and linuxcnc_stream share.
constexpr const char* PERMIT_SIGNAL = "permit";          ///< bit: motion is permitted
constexpr const char* BEAT_SIGNAL = "beat";              ///< bit: toggles while linuxcnc_stream runs
constexpr const char* LOAD_SIGNAL = "load";              ///< float: spindle load, 1 is full scale
constexpr const char* FEED_SIGNAL = "adaptive_feed";     ///< float: input of motion.adaptive-feed (M52)
constexpr const char* SPINDLE_SIGNAL = "spindle_scale";  ///< float: factor on spindle.0.speed-out
constexpr const char* SAMPLER_PINS = "fffffffffs";

struct ConfigurationOptions {
  int tools = 20;  ///< T1 to this number are in the tool table, with length 0: positions are those of the tip
  double speed_tolerance = 10.0;  ///< [rpm] of a spindle at speed, in addition to 1 %
  double limit_margin = 1e-3;  ///< [mm] of the limits: a home at the end of travel may round to either side
  double standstill = 0.5;     ///< [rpm] of a spindle at rest
  double orient_gain = 20.0;   ///< [1/s] settles in 0.3 s, slow against the servo period
  double orient_max_speed = 5.0;   ///< [rev/s] of an orientation
  double orient_tolerance = 0.02;  ///< [deg] a quarter of a count of M119
  /// [s] of servo cycles without a beat. A servo thread that has waited for a processor catches up without a
  /// beat in between, which must not count as the end of linuxcnc_stream; the gateway detects that end at
  /// once.
  double beat_lasts = LivenessOptions().starves + 0.2;
};

/// Configuration of a LinuxCNC without hardware: ideal axes with the model's travel, rapid feed and
/// acceleration; a spindle with the model's acceleration, orientation (M19) and a revolution counter. The
/// emergency stop chain depends on the permit of linuxcnc_stream. @param folder of the files @return text by
/// file name
/// @throws Error naming the missing value of the model.
std::map<std::string, std::string> configurationOf(const MachineModel& model, const std::string& folder,
                                                   const ConfigurationOptions& options = {});

}  // namespace smartmill::cnc::linuxcnc
