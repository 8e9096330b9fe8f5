#include "smartmill_cnc/linuxcnc/configuration.h"

#include <cstdio>
#include <sstream>

#include "smartmill_cnc/linuxcnc/protocol.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc::linuxcnc {
namespace {

std::string number(double value) {
  return formatted("%.9g", value);
}

std::string jointSection(const MachineAxes& axes, std::size_t axis, const ConfigurationOptions& options) {
  const double mm = 1.0 / units::MM;
  std::string common = "MAX_VELOCITY = " + number(axes.rapid * mm) +
                       "\nMAX_ACCELERATION = " + number(axes.acceleration * mm) +
                       "\nMIN_LIMIT = " + number(axes.travel[axis][0] * mm - options.limit_margin) +
                       "\nMAX_LIMIT = " + number(axes.travel[axis][1] * mm + options.limit_margin) + "\n";
  const std::string home = number(axes.home[axis] * mm);
  return std::string("[AXIS_") + "XYZ"[axis] + "]\n" + common + "[JOINT_" + std::to_string(axis) + "]\n" +
         common + "TYPE = LINEAR\nFERROR = 1\nMIN_FERROR = 0.2\nHOME = " + home + "\nHOME_OFFSET = " + home +
         "\nHOME_SEQUENCE = 0\nHOME_ABSOLUTE_ENCODER = 2\n";
}

std::string iniOf(const MachineAxes& axes, double max_rpm, const std::string& folder,
                  const ConfigurationOptions& options) {
  std::ostringstream ini;
  ini << "[EMC]\nVERSION = 1.1\nMACHINE = smartmill\nNML_FILE = " << folder << "/mill.nml\n"
      << "[DISPLAY]\nDISPLAY = wait_for_end\nMAX_FEED_OVERRIDE = 1.0\n"
      << "[TASK]\nTASK = milltask\nCYCLE_TIME = 0.001\n"
      << "[RS274NGC]\nPARAMETER_FILE = mill.var\nSUBROUTINE_PATH = sub\n"
      << "[EMCMOT]\nEMCMOT = motmod\nSERVO_PERIOD = " << ServoBlock().period_ns << "\n"
      << "[EMCIO]\nEMCIO = io\nCYCLE_TIME = 0.002\nTOOL_TABLE = mill.tbl\n"
      << "[HAL]\nHALFILE = mill.hal\n"
      << "[TRAJ]\nCOORDINATES = X Y Z\nLINEAR_UNITS = mm\nANGULAR_UNITS = degree\nMAX_LINEAR_VELOCITY = "
      << number(axes.rapid / units::MM)
      << "\nMAX_LINEAR_ACCELERATION = " << number(axes.acceleration / units::MM)
      << "\n[KINS]\nKINEMATICS = trivkins coordinates=xyz\nJOINTS = 3\n"
      << "[SPINDLE_0]\nMAX_FORWARD_VELOCITY = " << number(max_rpm) << "\nMIN_FORWARD_VELOCITY = 0\n";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    ini << jointSection(axes, axis, options);
  }
  return ini.str();
}

std::string toolTable(int tools) {
  std::string table;
  for (int k = 1; k <= tools; ++k) {
    const std::string number = std::to_string(k);
    table += "T" + number + " P" + number + " D10 Z0\n";
  }
  return table;
}

void setp(std::ostringstream& hal, const char* pin, double value) {
  hal << "setp " << pin << " " << number(value) << "\n";
}

void spindleOf(std::ostringstream& hal) {
  hal << "net s-programmed spindle.0.speed-out => override.in0\n"
      << "net " << SPINDLE_SIGNAL << " override.in1\nsets " << SPINDLE_SIGNAL << " 1\n"
      << "net " << FEED_SIGNAL << " motion.adaptive-feed\nsets " << FEED_SIGNAL << " 1\n"
      << "net s-cmd override.out => drive.in0 atspeed.in1\n"
         "net s-drive drive.out => power.in1\n"
         "net s-on motion.motion-enabled => power.sel\n"
         "net s-power power.out => ramp.in\n"
         "net s-rpm ramp.out => spin.velocity-cmd rps.in atspeed.in2 standstill.in2 sampler.0.pin.4\n"
         "net s-rps rps.out => spindle.0.speed-in\n"
         "net s-revs spin.position-fb => spindle.0.revs orient.position opid.feedback sampler.0.pin.3\n"
         "net s-at atspeed.out => spindle.0.at-speed\n"
         "net s-standstill standstill.out => motion.digital-in-00\n"
         "net s-idx spindle.0.index-enable <=> spin.index-enable\n"
         "net o-on spindle.0.orient => orient.enable opid.enable drive.sel\n"
         "net o-angle spindle.0.orient-angle => orient.angle\n"
         "net o-mode spindle.0.orient-mode => orient.mode\n"
         "net o-cmd orient.command => opid.command\n"
         "net o-out opid.output => rpm.in\n"
         "net o-rpm rpm.out => drive.in1\n"
         "net o-ok orient.is-oriented => spindle.0.is-oriented\n";
}

std::string halOf(double spindle_acceleration, const ConfigurationOptions& options) {
  std::ostringstream hal;
  hal << "loadrt [KINS]KINEMATICS\n"
         "loadrt [EMCMOT]EMCMOT servo_period_nsec=[EMCMOT]SERVO_PERIOD num_joints=[KINS]JOINTS "
         "num_spindles=1\n"
         "loadrt sim_spindle names=spin\nloadrt limit2 names=ramp\nloadrt near names=atspeed,standstill\n"
         "loadrt scale names=rps,rpm\nloadrt mult2 names=override\nloadrt mux2 names=drive,power\nloadrt "
         "orient names=orient\n"
         "loadrt pid names=opid\nloadrt oneshot names=lives\nloadrt and2 names=may,chain\n"
         "loadrt sampler depth=4000 cfg="
      << SAMPLER_PINS << "\n";
  for (const char* function :
       {"lives", "may", "chain", "motion-command-handler", "motion-controller", "orient", "opid.do-pid-calcs",
        "rpm", "override", "drive", "power", "ramp", "spin", "rps", "atspeed", "standstill", "sampler.0"}) {
    hal << "addf " << function << " servo-thread\n";
  }
  setp(hal, "ramp.maxv", spindle_acceleration);
  setp(hal, "spin.scale", 1.0 / 60.0);
  setp(hal, "rps.gain", 1.0 / 60.0);
  setp(hal, "rpm.gain", 60.0);
  setp(hal, "atspeed.scale", 1.01);
  setp(hal, "atspeed.difference", options.speed_tolerance);
  setp(hal, "standstill.difference", options.standstill);
  setp(hal, "orient.tolerance", options.orient_tolerance);
  setp(hal, "opid.Pgain", options.orient_gain);
  setp(hal, "opid.maxoutput", options.orient_max_speed);
  hal << "setp opid.error-previous-target 0\nsetp lives.falling 1\n";
  setp(hal, "lives.width", options.beat_lasts);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string joint = "joint." + std::to_string(axis), name(1, "xyz"[axis]);
    hal << "net " << name << "-motor " << joint << ".motor-pos-cmd => " << joint << ".motor-pos-fb\nnet "
        << name << " " << joint << ".pos-cmd => sampler.0.pin." << axis << "\n";
  }
  spindleOf(hal);
  hal << "net v motion.current-vel => sampler.0.pin.5\n"
         "net dtg motion.distance-to-go => sampler.0.pin.6\n"
      << "net " << LOAD_SIGNAL << " sampler.0.pin.7\n"
      << "net marker motion.analog-out-00 => sampler.0.pin.8\n"
         "net t-number iocontrol.0.tool-number => sampler.0.pin.9\n"
         "# Without the beat and the permit of linuxcnc_stream no axis and no spindle moves, and the "
         "emergency "
         "stop is set\n"
      << "net " << BEAT_SIGNAL << " lives.in\nnet lives lives.out => may.in0\nnet " << PERMIT_SIGNAL
      << " may.in1\nnet may may.out => motion.enable chain.in0\n"
         "net estop iocontrol.0.user-enable-out => chain.in1\n"
         "net chain chain.out => iocontrol.0.emc-enable-in\n"
         "net t1 iocontrol.0.tool-prepare => iocontrol.0.tool-prepared\n"
         "net t2 iocontrol.0.tool-change => iocontrol.0.tool-changed\n";
  return hal.str();
}

}  // namespace

std::map<std::string, std::string> configurationOf(const MachineModel& model, const std::string& folder,
                                                   const ConfigurationOptions& options) {
  const MachineAxes& axes = model.needAxes("configure LinuxCNC");
  const Spindle& spindle = model.needSpindle("configure LinuxCNC");
  if (!spindle.max_speed || !spindle.acceleration) {
    throw Error(model.file +
                ": spindle.max_speed_rpm and acceleration_rpm_per_s are required to configure LinuxCNC");
  }
  return {{"mill.ini", iniOf(axes, units::rpmFromRadPerSec(*spindle.max_speed), folder, options)},
          {"mill.hal", halOf(units::rpmFromRadPerSec(*spindle.acceleration), options)},
          {"mill.tbl", toolTable(options.tools)}};
}

}  // namespace smartmill::cnc::linuxcnc
