#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_sim/turning/lathe.h"
#include "smartmill_sim/turning/turning_passes.h"
#include "smartmill_sim/twin/spindle_drive.h"
#include "smartmill_sim/world/motor_currents.h"

namespace smartmill::sim {

/// Forces of the turning cut relative to that along the feed, which the lathe simulates.
struct TurningForces {
  double tangential_ratio = 1.491;
  double radial_ratio = 0.5;

  void declare(ParameterTable& table);
  /// Force on the tool [N], machine X, Y, Z: against the feed, along the cutting speed (+Y), away from the
  /// workpiece. @param feed_force [N] @param angle [rad] of the feed, see feedDirection()
  std::array<double, 3> onTool(double feed_force, double angle) const;
};

/// Axes, drives and spindle of a turning centre with their motor currents.
struct TurningTraits {
  TurningForces forces;
  PassTraits passes;
  MotorTraits motor = turningMotors();  ///< `currents`: whether there are drives

  void declare(ParameterTable& table);
  /// @throws Error naming key and value.
  void validate() const { passes.validate(); }
  /// The turning centre of Cheng & Venuvinod: force per ampere of Table 1; the weight of the X slide aids the
  /// infeed (air-cutting currents 1.3 and 1.9 A: weight 318 N, friction 60 N); feed motors at most 16 Hz.
  static MotorTraits turningMotors();
};

/// The lathe in a turning centre: it does passes, its cutting force loads the feed motors and the spindle
/// motor, and a controller reports axes, spindle load and condition of the cut, as the bridge to a controller
/// does.
class TurningMachine {
 public:
  /// @param lathe must outlive this. @param spindle friction and load meter. @throws Error on bad traits or
  /// without load_meter_full_scale_v.
  TurningMachine(Lathe& lathe, const TurningTraits& traits, const LatheTraits& lathe_traits,
                 const Spindle& spindle);

  /// Streams of one block; stamps from the start of the simulation [s].
  struct Block {
    Lathe::Block sensors;
    SampleBlock motor_current;
    ForceBlock force;                           ///< true force on the tool
    CncState state;                             ///< at the end
    LoadSample load;                            ///< at the end
    std::optional<CuttingCondition> condition;  ///< if one begins
  };
  /// The next samples. @param count > 0
  Block advance(std::size_t count);

 private:
  Lathe& lathe_;
  TurningTraits traits_;
  double rate_;
  TurningPasses passes_;
  MotorCurrents motors_;
  SpindleDrive drive_;
  double full_scale_, voltage_ = 0.0;  // [V]
  std::uint64_t index_ = 0;
};

}  // namespace smartmill::sim
