#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "smartmill_core/names.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_exchange/items/asset.h"
#include "smartmill_exchange/items/observation.h"
#include "smartmill_recording/messages.h"

namespace smartmill::exchange {

struct TranslatorParameters {
  double sample_period = 0.1;
  double force_interval = 0.1;
  double input_timeout = 2.0;

  void declare(ParameterTable& table) {
    table.number("sample_period", sample_period, "s", Range::closed(0.0, 60.0),
                 "least time between two values of a sample; events and conditions are passed on at once");
    table.number(
        "force_interval", force_interval, "s", Range::closed(0.01, 60.0),
        "least time of whole revolutions over which peaks and effective values of the force are taken");
    table.number("input_timeout", input_timeout, "s", Range::above(0.0),
                 "without a message of a topic for this time its items are unavailable");
  }
};

/// Turns the messages of the graph into values of data items and into assets: the same for a node and a
/// recording. A value equal to the last one of its item is not repeated. Not thread-safe.
class Translator {
 public:
  struct Sink {
    std::function<void(const Observation&)> observe;
    std::function<void(const Asset&)> store;
  };
  Translator(const TranslatorParameters& parameters, Sink sink);
  ~Translator();

  /// @param received [s] time of reception. @throws Error on a message that contradicts itself
  void take(const plain::CncState& message, double received);
  void take(const plain::CncAlarms& message, double received);
  void take(const plain::LoadSample& message, double received);
  void take(const plain::MachineTemperature& message, double received);
  void take(const plain::CuttingCondition& message, double received);
  void take(const plain::SpindleAngle& message, double received);
  void take(const plain::ForceBlock& message, double received);
  void take(const plain::ForceEstimate& message, double received);
  void take(const plain::ForceSensorState& message, double received);
  void take(const plain::ChatterState& message, double received);
  void take(const plain::SpindleHealth& message, double received);
  void take(const plain::CuttingCoefficients& message, double received);
  void take(const plain::ModalModel& message, double received);
  void take(const plain::StabilityChart& message, double received);

  /// Items of silent topics become unavailable. @param now [s] as received
  void tick(double now);

  /// Calls on.template operator()<Message>(topic) for every topic that is read.
  template <class On>
  static void forEachTopic(On&& on) {
    on.template operator()<plain::CncState>(names::CNC_STATE);
    on.template operator()<plain::CncAlarms>(names::CNC_ALARMS);
    on.template operator()<plain::LoadSample>(names::CNC_LOAD);
    on.template operator()<plain::MachineTemperature>(names::MACHINE_TEMPERATURE);
    on.template operator()<plain::CuttingCondition>(names::CUTTING_CONDITION);
    on.template operator()<plain::SpindleAngle>(names::SPINDLE_ANGLE);
    on.template operator()<plain::ForceBlock>(names::FORCE_COMPENSATED);
    on.template operator()<plain::ForceEstimate>(names::FORCE_ESTIMATE);
    on.template operator()<plain::ForceSensorState>(names::FORCE_SENSOR);
    on.template operator()<plain::ChatterState>(names::CHATTER_STATE);
    on.template operator()<plain::SpindleHealth>(names::SPINDLE_HEALTH);
    on.template operator()<plain::CuttingCoefficients>(names::COEFFICIENTS);
    on.template operator()<plain::ModalModel>(names::TOOL_MODES);
    on.template operator()<plain::StabilityChart>(names::STABILITY_CHART);
  }

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::exchange
