#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/units.h"
#include "smartmill_sim/controller/controller.h"

namespace smartmill::sim {

constexpr double DT = 1e-3;      // [s]
constexpr double ROUND = 1e-12;  // rounding of numbers near 1
constexpr double RPM = units::TWO_PI / 60.0;

inline ControllerOptions testOptions() {
  ControllerOptions options;
  options.axes.travel = {{{-0.25, 0.25}, {-0.2, 0.2}, {-0.3, 0.0}}};
  options.axes.rapid = 0.5;
  options.axes.acceleration = 2.0;
  options.spindle_max_speed = 20000.0 * RPM;
  options.spindle_acceleration = 500.0;
  return options;
}

/// A controller with a client in the same process.
struct Machine {
  explicit Machine(const ControllerOptions& options = testOptions()) : controller(options) {}

  void send(const std::string& text) { ASSERT_EQ(calls.dnc.dncData(text.data(), text.size()), text.size()); }
  void start(const std::string& text) {
    ASSERT_EQ(calls.dnc.dncStart(), focas::EW_OK);
    send(text);
  }
  const std::vector<MotionState>& run(double seconds, double dt = DT) {
    controller.advance(dt, static_cast<std::size_t>(std::lround(seconds / dt)), states);
    return states;
  }
  std::optional<double> macro(int number) const {
    std::optional<double> value;
    EXPECT_EQ(calls.macros.readMacro(number, &value), focas::EW_OK);
    return value;
  }
  /// Runs until the program ends. @return [s] time, to one step
  double runToEnd(double dt = DT, double most = 60.0) {
    for (double time = 0.0; time < most;) {
      run(dt, dt);
      time += dt;
      if (calls.state.status().run != focas::RUN_START) {
        return time;
      }
    }
    ADD_FAILURE() << "still runs after " << most << " s";
    return most;
  }
  std::string alarmText() const {
    const auto alarms = calls.state.alarmMessages();
    return alarms.empty() ? "" : alarms.front().text;
  }

  Controller controller;
  const focas::ControllerInterface calls = controller.calls();
  std::vector<MotionState> states;
};

}  // namespace smartmill::sim
