#include "smartmill_sim/twin/twin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/campaign/record_columns.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/axis_motion.h"
#include "smartmill_sim/twin/burst_times.h"
#include "smartmill_sim/twin/cut_traces.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "smartmill_sim/twin/tip_trajectory.h"
#include "twin/record_zeros.h"
#include "twin/steady_test.h"
#include "twin/tap_input.h"
#include "twin/tone_phases.h"

namespace smartmill::sim {
namespace {

// Means over the sample intervals: x + x'' dt^2 / 24, with an error of fourth order in frequency over sample
// rate.
void average(std::vector<double>& x) {
  double before = x.front();
  for (std::size_t i = 1; i + 1 < x.size(); ++i) {
    const double now = x[i];
    x[i] += (x[i + 1] - 2.0 * now + before) / 24.0;
    before = now;
  }
}

// Whether this twin simulates a column: inputs and channels of the measuring chain.
bool isSimulated(const std::string& column, const CampaignTest& test) {
  if (column == "spindle_angle" || column == "hammer" || motionAxis(column)) return true;
  // The position of these sensors is known only for a tap: at the hit point.
  if (column == channelName(DISPLACEMENT) || column == channelName(ACCELERATION))
    return test.kind == TestKind::tap && test.direction != "z";
  for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
    if (column == channelName(c)) return true;
  }
  return false;
}

// Times of a test for effects in time.
CuttingMachine::Clock clockOf(const MachineModel& model, const CampaignTest& test, const Record& record) {
  for (const EffectEntry& effect : model.effects) {
    const EffectKind* kind = findEffect(effect.name);
    if (!kind || !actsIn(kind->stage, test.kind)) continue;
    const bool shows = kind->stage != Stage::drive || record.has("load_meter");
    const char* missing = nullptr;
    if (kind->has(EffectNeed::start_time) && shows && !test.start_time) missing = "start_time_s";
    const auto clock = effect.words.find("clock");
    if (clock != effect.words.end() && clock->second == "machine" && !test.start_time)
      missing = "start_time_s";
    if (kind->has(EffectNeed::cut_time) && !test.cut_time_before) missing = "cut_time_before_s";
    if (missing)
      throw Error("test " + test.name + ": " + missing + " is missing (effect " + effect.name + " needs it)");
  }
  return {test.start_time.value_or(0.0), test.cut_time_before.value_or(0.0), true};
}

// Simulates step by step: channels before the signal stage at each sample, with substeps between the samples.
// input(i, share): input between sample i (share 0) and the next one (share 1).
template <class Input>
void simulateByStep(CuttingMachine& machine, std::size_t samples, int substeps, const Input& input,
                    const ChannelRows& out) {
  CuttingMachine::Output now, between;
  for (std::size_t i = 0; i < samples; ++i) {
    machine.step(input(i, 0.0), now);
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (out[c]) (*out[c])[i] = now.raw[c];
    }
    for (int s = 1; s < substeps; ++s) machine.step(input(i, static_cast<double>(s) / substeps), between);
  }
}

// Simulates stage by stage. input(i, share, input): updates the input of a step.
template <class Input>
void simulateByStage(CuttingMachine& machine, std::size_t samples, int substeps, const Input& input,
                     const ChannelRows& out) {
  const auto every = static_cast<std::size_t>(substeps);
  std::array<std::vector<double>, CHANNEL_COUNT> fine;
  ChannelRows rows = out;
  for (std::size_t c = 0; c < CHANNEL_COUNT && every > 1; ++c) {
    if (!out[c]) continue;
    fine[c].resize(samples * every);
    rows[c] = &fine[c];
  }
  machine.run(
      samples * every,
      [&](std::size_t step, CuttingMachine::Input& at) {
        const std::size_t i = every > 1 ? step / every : step;
        input(i, every > 1 ? static_cast<double>(step - i * every) / substeps : 0.0, at);
      },
      rows);
  for (std::size_t c = 0; c < CHANNEL_COUNT && every > 1; ++c) {
    for (std::size_t i = 0; i < samples && out[c]; ++i) (*out[c])[i] = fine[c][i * every];
  }
}

// Runs the machine over the record. move(rows): writes the channels before the signal stage at each sample;
// recorded: nullptr if there is none.
template <class Move>
void run(const MachineModel& model, const CampaignTest& test, const SimulationOptions& options,
         CuttingMachine& machine, const Move& move, const Record* recorded, Record& record) {
  machine.setClock(clockOf(model, test, record));
  if (record.has("load_meter")) {
    model.needSpindle("simulate load_meter");
    if (!test.running_before) machine.resetLoadMeter(test.spindle_speed);
  }
  ChannelRows out{};
  std::vector<std::size_t> simulated_channels;
  for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
    if (!record.has(channelName(c))) continue;
    out[c] = &record.add(channelName(c));
    simulated_channels.push_back(c);
  }
  if (options.channels) machine.selectChannels(simulated_channels);
  move(out);

  if (model.force_sensor.mean_samples) {
    for (const std::size_t c : {FX, FY, FZ}) {
      if (out[c]) average(*out[c]);
    }
  }
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  const SignalStage signals = machine.signalStage();
  for (Tone* tone : signals.tones()) {
    const double frequency = tone->rate(test.spindle_speed) / units::TWO_PI;
    for (std::size_t a = 0; a < 3 && tone->on_sensor; ++a)
      tone->response[a] = machine.model().force_sensor.axis[a].response(frequency);
  }
  const Record* const phases = options.random_phases ? nullptr : recorded;
  findPhases(phases, out, test.sample_rate, test.spindle_speed, signals, random);
  findBursts(phases, out, test.sample_rate, signals, random);
  findZeros(test, recorded, out, signals);
  for (std::size_t i = 0; i < record.size() && (options.noise || signals.acts()); ++i) {
    ChannelValues values{};
    for (const std::size_t c : simulated_channels) values[c] = (*out[c])[i];
    signals.apply(static_cast<double>(i) / test.sample_rate, values);
    if (options.noise) {
      for (const std::size_t c : {FX, FY, FZ}) {
        if (out[c] && model.force_sensor.noise_rms)
          values[c] += (*model.force_sensor.noise_rms)[c] * normal(random);
      }
      values[LOAD_METER] = machine.rounded(values[LOAD_METER]);
    }
    for (const std::size_t c : simulated_channels) (*out[c])[i] = values[c];
  }
}

Record simulateTap(const MachineModel& model, const CampaignTest& test, const Record* recorded, Record record,
                   const SimulationOptions& options, CuttingMachine& machine) {
  const std::vector<double> hammer = contactForce(record.column("hammer"));
  const std::size_t axis = test.direction == "x" ? 0 : test.direction == "y" ? 1 : 2;
  if (axis < 2) machine.setProbe(axis);
  const TapTarget target = targetOf(recorded ? *recorded : record, axis);
  const auto input = [&](std::size_t i, double share) {
    CuttingMachine::Input hit;
    const double force = interpolated(hammer, i, share);
    if (target.tip) hit.tip_force[axis] = force;
    if (target.sensor) hit.sensor_force[axis] = force;
    return hit;
  };
  const std::size_t samples = record.size();
  run(
      model, test, options, machine,
      [&](const ChannelRows& out) { simulateByStep(machine, samples, options.substeps, input, out); },
      recorded, record);
  return record;
}

// Fills the spindle angle of a record.
void fillAngle(Record& record, double phase, double speed, const std::optional<SpeedVariation>& variation) {
  if (!record.has("spindle_angle")) return;
  std::vector<double>& angle = record.add("spindle_angle");
  for (std::size_t i = 0; i < record.size(); ++i) {
    const double turn = speed * (record.time[i] - record.time[0]);
    angle[i] = std::fmod(phase + (variation ? variation->angle(turn) : turn), units::TWO_PI);
    if (angle[i] < 0.0) angle[i] += units::TWO_PI;
  }
}

std::optional<TipTrajectory> tipTrajectoryOf(const MachineModel& model, const CampaignTest& test,
                                             const Record* recorded, const SimulationOptions& options,
                                             const CuttingMachine& machine) {
  // The displacement of a vibrating workpiece is not recorded.
  const bool known = recorded && TipTrajectory::isAvailable(*recorded) && model.workpiece_modes.empty();
  if (!options.guided || test.kind != TestKind::cut || test.running_before || !machine.vibrates() || !known)
    return {};
  return TipTrajectory(machine.model(), *recorded, test.sample_rate, options);
}

std::optional<AxisMotion> motionOf(const MachineModel& model, const CampaignTest& test,
                                   const Record* recorded, const SimulationOptions& options) {
  const bool needed = std::any_of(model.effects.begin(), model.effects.end(), [](const EffectEntry& effect) {
    const EffectKind* kind = findEffect(effect.name);
    return kind && kind->has(EffectNeed::axis_motion);
  });
  if (!needed || !recorded || !AxisMotion::isRecorded(*recorded)) return {};
  return AxisMotion(*recorded, test.sample_rate, options.axis_smoothing);
}

Record simulateOn(CuttingMachine& machine, const MachineModel& model, const CampaignTest& test,
                  const Record* recorded, Record record, double phase,
                  const std::optional<TipTrajectory>& trajectory, const SimulationOptions& options) {
  if (test.kind == TestKind::tap)
    return simulateTap(model, test, recorded, std::move(record), options, machine);
  fillAngle(record, phase, test.spindle_speed, options.speed_variation);
  SteadyTest steady(model, test, phase, record.time.front(), options, machine);
  if (test.running_before) {
    machine.setClock(clockOf(model, test, record));
    if (record.has("load_meter")) machine.resetLoadMeter(test.spindle_speed);
    steady.leadIn();
  }
  const double dt = 1.0 / test.sample_rate;
  const std::optional<AxisMotion> motion = motionOf(model, test, recorded, options);
  const auto input = [&](std::size_t i, double share, CuttingMachine::Input& at) {
    steady.next(record.time[i] + share * dt, at);
    if (trajectory) at.tip = trajectory->at(i, share);
    if (motion) at.axis_acceleration = motion->acceleration(i, share);
  };
  run(
      model, test, options, machine,
      [&](const ChannelRows& out) { simulateByStage(machine, record.size(), options.substeps, input, out); },
      recorded, record);
  return record;
}

Record simulate(const MachineModel& model, const CampaignTest& test, const Record* recorded, Record record,
                double phase, const SimulationOptions& options) {
  if (options.substeps < 1) throw Error("simulation: substeps below 1");
  if (options.speed_variation) options.speed_variation->validate();
  CuttingMachine machine(model, 1.0 / (test.sample_rate * options.substeps),
                         options.speed_variation ? Feed::any : Feed::steady, options.corner_slices);
  const std::optional<TipTrajectory> trajectory = tipTrajectoryOf(model, test, recorded, options, machine);
  if (trajectory) machine.prescribeTip();
  const auto simulated = [&] {
    return simulateOn(machine, model, test, recorded, std::move(record), phase, trajectory, options);
  };
  if (!options.traces || !(test.kind == TestKind::cut || machine.vibrates())) return simulated();
  // If the motion of the tip follows from the forces, it depends on the sensor and the tool's modes.
  std::vector<double> values = trajectory && TipTrajectory::isFromForce(*recorded)
                                   ? valuesOfRecord(model, test.kind)
                                   : valuesOfTrace(model, test.kind, trajectory.has_value());
  if (const auto cached = options.traces->find(values)) {
    machine.replayTrace(cached.get());
    return simulated();
  }
  const auto recorded_trace = std::make_shared<CutTrace>();
  machine.recordTrace(recorded_trace.get());
  Record result = simulated();
  options.traces->insert(std::move(values), recorded_trace);
  return result;
}

}  // namespace

double recordedPhase(const CampaignTest& test, const Record& recorded) {
  if (test.kind == TestKind::tap || !recorded.has("spindle_angle")) return 0.0;
  const std::vector<double>& angle = recorded.column("spindle_angle");
  double s = 0.0, c = 0.0;
  for (std::size_t i = 0; i < angle.size(); ++i) {
    // On the grid of the sample rate, as in the simulation.
    const double turned = test.spindle_speed * static_cast<double>(i) / test.sample_rate;
    s += std::sin(angle[i] - turned);
    c += std::cos(angle[i] - turned);
  }
  // A line of non-integer order distinguishes revolutions: the result is on the revolution of the record's
  // first sample, 0..2 pi.
  return angle[0] + std::remainder(std::atan2(s, c) - angle[0], units::TWO_PI);
}

Record simulateTest(const MachineModel& model, const CampaignTest& test, const Record& recorded,
                    const SimulationOptions& options) {
  if (recorded.size() == 0) throw Error(recorded.file + ": no samples");
  Record record;
  record.file = recorded.file;
  // Grid of the sample rate: times in a file are rounded.
  for (std::size_t i = 0; i < recorded.size(); ++i)
    record.time.push_back(recorded.time[0] + static_cast<double>(i) / test.sample_rate);
  const auto requested = [&](const std::string& name) {
    return name == "hammer" || motionAxis(name) || !options.channels ||
           std::find(options.channels->begin(), options.channels->end(), name) != options.channels->end();
  };
  for (const std::string& name : recorded.names) {
    if (isSimulated(name, test) && requested(name)) record.add(name) = recorded.column(name);
  }
  const double phase = options.phase ? *options.phase : recordedPhase(test, recorded);
  return simulate(model, test, &recorded, std::move(record), phase, options);
}

Record simulateTest(const MachineModel& model, const CampaignTest& test, double duration,
                    const SimulationOptions& options) {
  if (!(duration > 0.0))
    throw Error("simulation: duration " + std::to_string(duration) + " s is not positive");
  if (test.kind == TestKind::tap) throw Error("simulation: a tap needs a recorded hammer force");
  if (test.kind == TestKind::move) throw Error("simulation: a move needs a recorded motion of an axis");
  Record record;
  const auto samples = static_cast<std::size_t>(std::llround(duration * test.sample_rate));
  for (std::size_t i = 0; i < samples; ++i) record.time.push_back(static_cast<double>(i) / test.sample_rate);
  for (const char* name : {"spindle_angle", "fx", "fy", "fz"}) record.add(name).assign(samples, 0.0);
  if (model.spindle) record.add("load_meter").assign(samples, 0.0);
  std::mt19937_64 random(options.seed ^ 0x5eedULL);
  const double drawn = std::uniform_real_distribution<double>(0.0, units::TWO_PI)(random);
  return simulate(model, test, nullptr, std::move(record), options.phase.value_or(drawn), options);
}

}  // namespace smartmill::sim
