#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_focas/controller_interface.h"
#include "smartmill_sim/controller/motion_watch.h"

namespace smartmill::sim {

constexpr double LOAD_METER_STEP = 3.0e-4;  ///< [V] resolution of the load meter (Dunwoody 3.2.1)

struct ControllerOptions {
  MachineAxes axes;                   ///< travel, rapid, acceleration, home (where it starts)
  double spindle_max_speed = 0.0;     ///< [rad/s] limits S
  double spindle_acceleration = 0.0;  ///< [rad/s2] without load
  double spindle_torque = 0.0;        ///< [N m] limit of the drive; 0: the load does not slow the spindle
  double orient_speed = 20.0;         ///< [rad/s] of M19 and M119: about 190 rpm, typical of spindles
  double speed_tolerance = 0.05;      ///< [1] of the signal "at speed", relative to the commanded speed
  double arc_tolerance =
      20e-6;                   ///< [m] difference of the start and end radius of an arc: rounded centres pass
  double check_period = 2e-3;  ///< [s] between two calls of the watches: 1 mm of rapid traverse
  double loop_gain = 3000.0;   ///< [0.01/s] reported, of the axes' position loops: a typical value
  double screw_lead = 10e-3;   ///< [m] of travel per reported revolution of an axis motor
  double motor_temperature = 25.0;  ///< [deg C] of the shop and of the motors at the start
  double motor_load_rise = 40.0;  ///< [K] steady rise at 100 % load; with the idle rise below the 105 K that
                                  ///< insulation of class F permits
  double motor_idle_rise = 20.0;  ///< [K] steady rise of the spindle motor at its highest speed without load
  double motor_time_constant = 1500.0;           ///< [s] of the motors' heating: typical of servo motors
  std::size_t memory_size = 512 * 1024;          ///< [byte] of programs: 1280 m of tape, an option of a 30i
  std::array<double, 3> work_offset{{0, 0, 0}};  ///< [m] machine minus absolute position, of G54
  std::vector<int> magazine;                     ///< numbers of the tools to which M6 changes
  double tool_change_time = 2.0;                 ///< [s] of M6 with the spindle at rest
  focas::SysInfo info = fineInfo();              ///< reported identification
  int mode = focas::AUT_REMOTE;                  ///< focas::Aut, set at the panel
  std::size_t buffer_size = 1024;                ///< [byte] of DNC text that has not run
  double load_step = 0.0;                        ///< [percent] resolution of the polled loads; 0: not rounded
  std::vector<std::shared_ptr<const MotionWatch>> watches;  ///< called in this order while the machine moves
  std::function<std::int64_t()>
      wall_clock;  ///< [s] since 1970, of the controller's calendar; empty: the computer's clock

  /// @throws Error naming key and value.
  void validate() const;

  /// From a model's sections axes, spindle, hammer, tool and workpiece. Loads are rounded to
  /// LOAD_METER_STEP. Defaults: travel x -250..250, y -200..200, z -300..0 mm, home 0 0 0, rapid 30 m/min, 5
  /// m/s2; spindle up to 20000 rpm, 10000 rpm/s.
  static ControllerOptions ofModel(const MachineModel& model);
  /// Identification with a position increment of 0.1 um.
  static focas::SysInfo fineInfo();
};

}  // namespace smartmill::sim
