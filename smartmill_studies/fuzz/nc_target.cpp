#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "fuzz/targets.h"
#include "smartmill_cnc/motion/nc_program.h"
#include "smartmill_sim/controller/controller.h"
#include "smartmill_sim/controller/nc_block.h"

namespace smartmill::fuzz {
namespace {

constexpr double STEP = 0.05;   // [s]
constexpr int MOST_STEPS = 40;  // of a program
constexpr double TOLERANCE =
    1e-6;  // [m] rounding of transmitted values, summed over the relative moves of a program
constexpr std::size_t MOST_TEXT = 900;  // [byte]

sim::ControllerOptions makeOptions() {
  sim::ControllerOptions o;
  o.axes.travel = {{{-0.25, 0.25}, {-0.2, 0.2}, {-0.3, 0.1}}};
  o.axes.rapid = 10.0;
  o.axes.acceleration = 1000.0;
  o.spindle_max_speed = 2000.0;
  o.spindle_acceleration = 1e6;
  return o;
}

const sim::ControllerOptions& options() {
  static const sim::ControllerOptions OPTIONS = makeOptions();
  return OPTIONS;
}

/// Runs a program; the axes must not leave their travel.
void run(sim::Controller& controller, const std::string& text) {
  static std::vector<sim::MotionState> states;
  if (controller.calls().dnc.dncStart() != focas::EW_OK) {
    std::abort();
  }
  controller.calls().dnc.dncData(text.data(), text.size());
  controller.calls().dnc.dncEnd();
  for (int i = 0; i < MOST_STEPS; ++i) {
    controller.advance(STEP, 1, states);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& travel = options().axes.travel[k];
      if (!(states[0].position[k] >= travel[0] - 1e-8 && states[0].position[k] <= travel[1] + 1e-8)) {
        std::abort();
      }
    }
    if (controller.calls().state.status().run != focas::RUN_START) {
      break;
    }
  }
}

}  // namespace

void nc(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), std::min(size, MOST_TEXT));
  {
    sim::Controller controller(options());
    run(controller, text);
  }
  // A program that passes the check of the bridge runs without leaving the travel.
  cnc::MotionLimits limits;
  limits.travel = options().axes.travel;
  limits.max_feed = options().axes.rapid;
  limits.max_spindle_speed = options().spindle_max_speed;
  cnc::DialectOptions dialect;
  dialect.decimals = 4;
  const cnc::NcCheck check = cnc::checkProgram(text, {}, limits, dialect);
  if (check.verdict != cnc::NcVerdict::good || check.text.size() > MOST_TEXT) {
    return;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    if (!(check.end[k] >= limits.travel[k][0] - TOLERANCE &&
          check.end[k] <= limits.travel[k][1] + TOLERANCE)) {
      std::abort();
    }
  }
  sim::Controller controller(options());
  run(controller, check.text);
  for (const focas::AlarmMessage& alarm : controller.calls().state.alarmMessages()) {
    if (alarm.type == sim::ALARM_OT) {
      std::fprintf(stderr, "passed the check: %s\nalarm %s\n", check.text.c_str(), alarm.text.c_str());
      std::abort();
    }
  }
}

}  // namespace smartmill::fuzz
