#include "simulated_session.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill {
namespace {

constexpr double DURATION = 1.0;         // [s] of a test
constexpr std::uint64_t PAUSE = 50;      // [steps] between tests
constexpr std::size_t BLOCK = 100;       // [samples] in a step
constexpr std::uint64_t LOAD_EVERY = 2;  // [steps]
double sixDigits(double value) {
  return std::strtod(formatted("%.6g", value).c_str(), nullptr);
}

}  // namespace

SimulatedSession::SimulatedSession(const std::string& path, const MachineModel& truth, double begin)
    : writer_(createRecording(path, RecordingCompression::lz4)), truth_(truth), begin_(begin) {
}

void SimulatedSession::slot(const std::string& name, double rpm, double feed, double depth) {
  CampaignTest test;
  test.name = name;
  test.kind = TestKind::cut;
  test.sample_rate = RATE;
  test.spindle_speed = units::radPerSecFromRpm(rpm);
  test.running_before = 0.5;
  test.engagement = Engagement{};
  test.engagement->feed_per_tooth = feed;
  test.engagement->axial_depth = depth;
  test.engagement->entry = 0.0;
  test.engagement->exit = units::PI;
  run(test);
}

void SimulatedSession::air(const std::string& name, double rpm) {
  CampaignTest test;
  test.name = name;
  test.kind = TestKind::air;
  test.sample_rate = RATE;
  test.spindle_speed = units::radPerSecFromRpm(rpm);
  test.running_before = 0.5;
  run(test);
}

void SimulatedSession::run(const CampaignTest& test) {
  sim::SimulationOptions options;
  options.seed = 7 + records_.size();
  Record record = sim::simulateTest(truth_, test, DURATION, options);
  for (const char* channel : FORCE_CHANNELS) {
    const auto at = static_cast<std::size_t>(std::find(record.names.begin(), record.names.end(), channel) -
                                             record.names.begin());
    for (double& value : record.columns.at(at)) value = sixDigits(value);
  }
  const double feed = test.engagement ? test.engagement->feed_per_tooth * truth_.tool->teeth *
                                            test.spindle_speed / units::TWO_PI
                                      : 0.0;
  CuttingCondition condition;
  condition.stamp = now();
  condition.kind = test.engagement ? CuttingCondition::Kind::cut : CuttingCondition::Kind::air;
  condition.name = test.name;
  condition.material = "aluminium";
  condition.tool_name = "endmill";
  condition.tool = *truth_.tool;
  if (test.engagement) condition.engagement = *test.engagement;
  condition.spindle_speed = test.spindle_speed;
  condition.steady_to = {DURATION * feed, 0.0, 0.0};
  write(names::CUTTING_CONDITION, condition);
  const std::vector<double>& angle = record.column("spindle_angle");
  const std::vector<double>& load = record.column("load_meter");
  if (records_.empty()) first_ = now();
  offsets_[test.name] = now() - first_;
  for (std::size_t first = 0; first + BLOCK <= record.size(); first += BLOCK, ++steps_) {
    CncState state;
    state.stamp = now();
    state.connected = state.motion = true;
    state.run = CncRun::start;
    state.mode = CncMode::dnc;
    state.axes = {"X", "Y", "Z"};
    state.position = {feed * record.time[first], 0.0, 0.0};
    state.distance_to_go = {0.0, 0.0, 0.0};
    state.spindle_speed = test.spindle_speed;
    state.feed = feed;
    write(names::CNC_STATE, state);
    write(names::SPINDLE_ANGLE, SpindleAngle{now(), angle[first], test.spindle_speed});
    if (steps_ % LOAD_EVERY == 0) {
      LoadSample sample;
      sample.stamp = now();
      sample.spindle_load = load[first] / *truth_.spindle->load_meter_full_scale;
      sample.spindle_speed = test.spindle_speed;
      write(names::CNC_LOAD, sample);
    }
    force(record, first);
  }
  records_[test.name] = std::move(record);
  CuttingCondition none;
  none.stamp = now();
  write(names::CUTTING_CONDITION, none);
  steps_ += PAUSE;
}

/// A block of the sensor, and the same as its compensation would publish it.
void SimulatedSession::force(const Record& record, std::size_t first) {
  SampleBlock measured;
  ForceBlock compensated;
  measured.stamp = compensated.stamp = now();
  measured.sample_rate = compensated.sample_rate = RATE;
  measured.first_index = compensated.first_index = samples_;
  compensated.status = ForceBlock::Status::compensated;
  for (const char* channel : FORCE_CHANNELS) {
    measured.channels.emplace_back(channel);
    measured.units.emplace_back("N");
  }
  for (std::size_t i = first; i < first + BLOCK; ++i) {
    for (std::size_t axis = 0; axis < FORCE_CHANNELS.size(); ++axis) {
      const double value = record.column(FORCE_CHANNELS[axis])[i];
      measured.samples.push_back(value);
      compensated.force[axis].push_back(value);
    }
  }
  samples_ += BLOCK;
  write(names::DYNAMOMETER, measured);
  write(names::FORCE_COMPENSATED, compensated);
}

void SimulatedSession::results() {
  for (const auto& [direction, model] :
       {std::pair("x", &truth_.tool_tip.x), std::pair("y", &truth_.tool_tip.y)}) {
    MeasuredFrf frf;
    frf.stamp = now();
    frf.tool = "endmill";
    frf.point = POINT_TOOL_TIP;
    frf.direction = direction;
    frf.frf.unit = "m/N";
    frf.frf.averages = 5;
    for (double frequency = 100.0; frequency <= 4000.0; frequency += 5.0) {
      frf.frf.frequency.push_back(frequency);
      frf.frf.value.push_back(model->response(frequency));
    }
    write(names::TOOL_FRF, frf);
    MeasuredModes modes;
    modes.stamp = now();
    modes.tool = "endmill";
    modes.point = POINT_TOOL_TIP;
    modes.direction = direction;
    modes.unit = "m/N";
    modes.model = *model;
    for (Mode& mode : modes.model.modes) {
      mode.frequency_std = 1e-4 * mode.frequency;
      mode.damping_ratio_std = 1e-2 * mode.damping_ratio;
      mode.gain_std = 1e-2 * mode.gain;
    }
    write(names::TOOL_MODES, modes);
  }
  CoefficientSet set;
  set.stamp = now();
  set.tool = "endmill";
  set.material = "aluminium";
  set.source = "load_meter";
  set.value = *truth_.cutting;
  set.friction_viscous = truth_.spindle->viscous;
  set.friction_coulomb = truth_.spindle->coulomb;
  set.tests = 3;
  write(names::COEFFICIENTS, set);
  ++steps_;
}

void SimulatedSession::close() {
  writer_->close();
}

}  // namespace smartmill
