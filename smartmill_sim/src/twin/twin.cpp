#include "smartmill_sim/twin/twin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "smartmill_core/campaign/record_columns.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/axis_motion.h"
#include "smartmill_sim/twin/burst_times.h"
#include "smartmill_sim/twin/cut_traces.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "smartmill_sim/twin/guide.h"

namespace smartmill::sim {
namespace {

const std::array<const char*, 2> TIP{{"tool_x", "tool_y"}};

// What ran before the record: so much of it is simulated, the depth of cut growing over the first part, since
// full cut at once makes the tool ring for long.
constexpr double LEAD = 0.4;           // [s]
constexpr double LEAST_STEADY = 0.1;   // [s] of running before a record that make it steady
constexpr double GROWING_SHARE = 0.6;  // [1] of the lead
constexpr double LEAST_GROWTH = 0.01;  // [1] of the depth at the beginning
constexpr long GROWTH_STEPS = 32;      // between two depths

// Means over the samples' intervals: x + x'' dt^2 / 24, good to the fourth order of frequency over sample
// rate.
void average(std::vector<double>& x) {
  double before = x.front();
  for (std::size_t i = 1; i + 1 < x.size(); ++i) {
    const double now = x[i];
    x[i] += (x[i + 1] - 2.0 * now + before) / 24.0;
    before = now;
  }
}

// From 0 at 0 smoothly to 1 at 1.
double growth(double x) {
  return x >= 1.0 ? 1.0 : x * x * (3.0 - 2.0 * x);
}

// Columns that this twin gives: inputs and the channels of the measuring chain.
bool gives(const std::string& column, const CampaignTest& test) {
  if (column == "spindle_angle" || column == "hammer" || motionAxis(column)) return true;
  // Where such a sensor stands is known of a tap only: where it is hit.
  if (column == channelName(DISPLACEMENT) || column == channelName(ACCELERATION))
    return test.kind == TestKind::tap && test.direction != "z";
  for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
    if (column == channelName(c)) return true;
  }
  return false;
}

// The force of a tap: zero outside the contact (Dunwoody section 4.3.1), where the record shows only noise,
// which would ring in the sensor's modes. A record with further hits stays as it is.
std::vector<double> contactForce(const std::vector<double>& hammer) {
  constexpr double SECOND_HIT = 0.05;
  if (hasSecondHit(hammer, SECOND_HIT)) return hammer;
  std::vector<double> force = impactWindow(hammer);
  for (std::size_t i = 0; i < force.size(); ++i) force[i] *= hammer[i];
  return force;
}

// Times of a test that effects in time need.
CuttingMachine::Clock clockOf(const MachineModel& model, const CampaignTest& test, const Record& record) {
  for (const EffectEntry& effect : model.effects) {
    const EffectKind* kind = findEffect(effect.name);
    if (!kind || !actsIn(kind->stage, test.kind)) continue;
    const bool shows = kind->stage != Stage::drive || record.has("load_meter");
    const char* lacks = nullptr;
    if (kind->has(EffectNeed::start_time) && shows && !test.start_time) lacks = "start_time_s";
    const auto clock = effect.words.find("clock");
    if (clock != effect.words.end() && clock->second == "machine" && !test.start_time) lacks = "start_time_s";
    if (kind->has(EffectNeed::cut_time) && !test.cut_time_before) lacks = "cut_time_before_s";
    if (lacks)
      throw Error("test " + test.name + ": " + lacks + " is missing (effect " + effect.name + " needs it)");
  }
  return {test.start_time.value_or(0.0), test.cut_time_before.value_or(0.0), true};
}

// Phases of tones that no model knows, from what the record shows beyond the twin without them: joint least
// squares of sine and cosine on every channel that a tone is in, about the means. Clipped samples do not
// count.
void findPhases(const Record& recorded, const std::array<std::vector<double>*, CHANNEL_COUNT>& early,
                double rate, double speed, const CuttingMachine& machine, const std::vector<Tone*>& tones) {
  const ChannelValues limits = machine.limits();
  const auto n = static_cast<Eigen::Index>(2 * tones.size());
  std::vector<double> amplitude;
  for (Tone* tone : tones) {
    amplitude.insert(amplitude.end(), tone->amplitude.begin(), tone->amplitude.end());
    tone->amplitude.fill(0.0);
  }
  const auto amplitudeOf = [&](Eigen::Index tone, std::size_t channel) {
    return amplitude[static_cast<std::size_t>(tone) * CHANNEL_COUNT + channel];
  };
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
  for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
    bool in_channel = false;
    for (Eigen::Index k = 0; k < n / 2; ++k) in_channel = in_channel || amplitudeOf(k, c) != 0.0;
    if (!in_channel || !early[c] || !recorded.has(channelName(c))) continue;
    const std::vector<double>& shown = recorded.column(channelName(c));
    Eigen::MatrixXd square = Eigen::MatrixXd::Zero(n + 1, n + 1);  // last: the mean
    Eigen::VectorXd product = Eigen::VectorXd::Zero(n + 1), row = Eigen::VectorXd::Ones(n + 1);
    for (std::size_t i = 0; i < shown.size(); ++i) {
      if (std::abs(shown[i]) > 0.98 * limits[c]) continue;
      const double t = static_cast<double>(i) / rate;
      ChannelValues values{};
      values[c] = (*early[c])[i];
      machine.finish(t, values);
      for (Eigen::Index k = 0; k < n / 2; ++k) {
        const double a = tones[static_cast<std::size_t>(k)]->rate(speed) * t;
        row(2 * k) = amplitudeOf(k, c) * std::sin(a);
        row(2 * k + 1) = amplitudeOf(k, c) * std::cos(a);
      }
      square += row * row.transpose();
      product += row * (shown[i] - values[c]);
    }
    if (square(n, n) <= 0.0) continue;
    const Eigen::VectorXd mean = square.col(n) / square(n, n);
    normal += (square - mean * square.row(n)).topLeftCorner(n, n);
    right += (product - mean * product(n)).head(n);
  }
  const Eigen::VectorXd wave = normal.completeOrthogonalDecomposition().solve(right);
  for (Eigen::Index k = 0; k < n / 2; ++k) {
    Tone& tone = *tones[static_cast<std::size_t>(k)];
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) tone.amplitude[c] = amplitudeOf(k, c);
    tone.phase = std::atan2(wave(2 * k + 1), wave(2 * k));
  }
}

// What a tap hits: the tool tip, the sensor or (when a program shows both answers in one record) both. A
// channel answers when it stands out of its noise after the hit.
struct TapTarget {
  bool tip, sensor;
};

TapTarget targetOf(const Record& record, std::size_t axis) {
  const std::vector<double>& hammer = record.column("hammer");
  const auto louder = [](double a, double b) { return std::abs(a) < std::abs(b); };
  const auto hit =
      static_cast<std::size_t>(std::max_element(hammer.begin(), hammer.end(), louder) - hammer.begin());
  const auto answers = [&](const char* channel) {
    constexpr std::size_t LEAST_QUIET = 20;
    if (!record.has(channel) || hit < 2 * LEAST_QUIET) return false;
    const std::vector<double>& x = record.column(channel);
    const auto quiet_end = x.begin() + static_cast<std::ptrdiff_t>(hit - LEAST_QUIET);
    const double deviation = standardDeviation({x.begin(), quiet_end}), level = mean({x.begin(), quiet_end});
    const auto peak = std::max_element(quiet_end, x.end(),
                                       [&](double a, double b) { return louder(a - level, b - level); });
    return std::abs(*peak - level) > 10.0 * deviation;
  };
  TapTarget target{false, answers(channelName(FX + axis))};
  if (axis < 2)
    target.tip = answers(channelName(TOOL_X + axis)) || answers("displacement") || answers("acceleration");
  if (!target.tip && !target.sensor) {
    // Silent channels: by what was measured at all.
    target.tip =
        axis < 2 && (record.has(TIP[axis]) || record.has("displacement") || record.has("acceleration"));
    target.sensor = !target.tip;
  }
  return target;
}

using Rows = CuttingMachine::EarlyRows;

// Step after step: early channels of each sample, with substeps between the samples.
// input(i, share): what happens at a share 0..1 of the way from sample i to the next.
template <class Input>
void stepThrough(CuttingMachine& machine, std::size_t samples, int substeps, const Input& input,
                 const Rows& out) {
  CuttingMachine::Output now, between;
  for (std::size_t i = 0; i < samples; ++i) {
    machine.step(input(i, 0.0), now);
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (out[c]) (*out[c])[i] = now.early[c];
    }
    for (int s = 1; s < substeps; ++s) machine.step(input(i, static_cast<double>(s) / substeps), between);
  }
}

// The same stage after stage. input(i, share, input): sets what moves on.
template <class Input>
void passThrough(CuttingMachine& machine, std::size_t samples, int substeps, const Input& input,
                 const Rows& out) {
  const auto every = static_cast<std::size_t>(substeps);
  std::array<std::vector<double>, CHANNEL_COUNT> fine;
  Rows rows = out;
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

// Runs the machine over the record; recorded columns are kept.
// move(rows): writes early channels of each sample. recorded: nullptr when there is none.
template <class Move>
void run(const MachineModel& model, const CampaignTest& test, const SimulationOptions& options,
         CuttingMachine& machine, const Move& move, const Record* recorded, Record& record) {
  machine.setClock(clockOf(model, test, record));
  if (record.has("load_meter")) {
    model.needSpindle("simulate load_meter");
    if (!test.running_before) machine.resetLoadMeter(test.spindle_speed);
  }
  Rows out{};
  std::vector<std::size_t> shown;
  for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
    if (!record.has(channelName(c))) continue;
    out[c] = &record.add(channelName(c));
    shown.push_back(c);
  }
  if (options.channels) machine.showOnly(shown);
  move(out);

  if (model.force_sensor.mean_samples) {
    for (const std::size_t c : {FX, FY, FZ}) {
      if (out[c]) average(*out[c]);
    }
  }
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  const std::vector<Tone*> tones = machine.tones();
  if (!tones.empty()) {
    if (recorded && !options.random_phases) {
      findPhases(*recorded, out, test.sample_rate, test.spindle_speed, machine, tones);
    } else {
      for (Tone* tone : tones)
        tone->phase = std::uniform_real_distribution<double>(0.0, units::TWO_PI)(random);
    }
  }
  findBursts(recorded && !options.random_phases ? recorded : nullptr, out, test.sample_rate, machine, random);
  for (std::size_t i = 0; i < record.size() && (options.noise || machine.finishes()); ++i) {
    ChannelValues values{};
    for (const std::size_t c : shown) values[c] = (*out[c])[i];
    machine.finish(static_cast<double>(i) / test.sample_rate, values);
    if (options.noise) {
      for (const std::size_t c : {FX, FY, FZ}) {
        if (out[c] && model.force_sensor.noise_rms)
          values[c] += (*model.force_sensor.noise_rms)[c] * normal(random);
      }
      values[LOAD_METER] = machine.rounded(values[LOAD_METER]);
    }
    for (const std::size_t c : shown) (*out[c])[i] = values[c];
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
      [&](const Rows& out) { stepThrough(machine, samples, options.substeps, input, out); }, recorded,
      record);
  return record;
}

// A spindle that turns steadily and, in a cut, a tool that is fed into its work.
class SteadyTest {
 public:
  // @param phase of tooth 1 [rad] at the time `begin` [s] of the first sample
  SteadyTest(const MachineModel& model, const CampaignTest& test, double phase, double begin,
             const SimulationOptions& options, CuttingMachine& machine)
      : test_(test),
        phase_(phase),
        begin_(begin),
        substeps_(options.substeps),
        // Half of what comes on linearly is there before the step ends.
        rise_(engagementRise(machine.vibrates()) + 2.0 * options.early_entry),
        machine_(machine),
        // A rounded time stamp must not put the sample of engagement on the wrong side.
        start_(test.engage_time.value_or(begin - 1.0) - 1e-3 / test.sample_rate) {
    if (!cut()) return;
    model.needCutting("simulate a cut");
    feed_ = test.engagement->feed_per_tooth * model.needTool("simulate a cut").teeth * test.spindle_speed /
            units::TWO_PI;
  }

  void inputAt(double t, CuttingMachine::Input& input) const {
    input.motion.angle = phase_ + test_.spindle_speed * (t - begin_);
    input.motion.speed = test_.spindle_speed;
    input.motion.velocity[0] = feed_;
    input.motion.centre[0] = feed_ * (t - begin_);
  }

  // The same in a record; the tool engages when its time has come.
  void next(double t, CuttingMachine::Input& input) {
    inputAt(t, input);
    if (!engaged_ && cut() && t >= start_) engage(input.motion, test_.engagement->axial_depth);
  }

  // What ran before the record.
  void lead() {
    // The same for every model, or what is compared would jump between models.
    const double time = *test_.running_before < LEAST_STEADY ? *test_.running_before : LEAD;
    const auto steps = static_cast<long>(time * test_.sample_rate * substeps_);
    const double step = 1.0 / test_.sample_rate / substeps_;
    CuttingMachine::Input input;
    CuttingMachine::Output out;
    for (long k = steps; k > 0; --k) {
      inputAt(begin_ - static_cast<double>(k) * step, input);
      if (cut() && (k % GROWTH_STEPS == 0 || !engaged_)) {
        const double share =
            LEAST_GROWTH + (1.0 - LEAST_GROWTH) * growth(static_cast<double>(steps - k) /
                                                         (GROWING_SHARE * static_cast<double>(steps)));
        if (!engaged_) engage(input.motion, share * test_.engagement->axial_depth);
        machine_.setDepth(share * test_.engagement->axial_depth);
      }
      machine_.step(input, out);
    }
    if (engaged_) machine_.setDepth(test_.engagement->axial_depth, feed_ * (*test_.running_before - time));
  }

 private:
  bool cut() const { return test_.kind == TestKind::cut; }
  void engage(const ToolMotion& now, double depth) {
    machine_.engage({{test_.engagement->entry, test_.engagement->exit, depth}}, now, rise_ * substeps_);
    engaged_ = true;
  }

  const CampaignTest& test_;
  double phase_, begin_;
  int substeps_;
  double rise_;  // [samples]
  CuttingMachine& machine_;
  double start_;       // [s] from which the tool is in cut
  double feed_ = 0.0;  // [m/s]
  bool engaged_ = false;
};

// The angle of a spindle that turns steadily, where a record asks for it.
void fillAngle(Record& record, double phase, double speed) {
  if (!record.has("spindle_angle")) return;
  std::vector<double>& angle = record.add("spindle_angle");
  for (std::size_t i = 0; i < record.size(); ++i) {
    angle[i] = std::fmod(phase + speed * (record.time[i] - record.time[0]), units::TWO_PI);
    if (angle[i] < 0.0) angle[i] += units::TWO_PI;
  }
}

std::optional<Guide> guideOf(const CampaignTest& test, const Record* recorded,
                             const SimulationOptions& options, const CuttingMachine& machine) {
  if (!options.guided || test.kind != TestKind::cut || test.running_before || !machine.vibrates() ||
      !recorded || !Guide::canBe(*recorded))
    return {};
  return Guide(machine.model(), *recorded, test.sample_rate);
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
                  const Record* recorded, Record record, double phase, const std::optional<Guide>& guide,
                  const SimulationOptions& options) {
  if (test.kind == TestKind::tap)
    return simulateTap(model, test, recorded, std::move(record), options, machine);
  fillAngle(record, phase, test.spindle_speed);
  SteadyTest steady(model, test, phase, record.time.front(), options, machine);
  if (test.running_before) {
    machine.setClock(clockOf(model, test, record));
    if (record.has("load_meter")) machine.resetLoadMeter(test.spindle_speed);
    steady.lead();
  }
  const double dt = 1.0 / test.sample_rate;
  const std::optional<AxisMotion> motion = motionOf(model, test, recorded, options);
  const auto input = [&](std::size_t i, double share, CuttingMachine::Input& at) {
    steady.next(record.time[i] + share * dt, at);
    if (guide) at.tip = guide->at(i, share);
    if (motion) at.axis_acceleration = motion->acceleration(i, share);
  };
  run(
      model, test, options, machine,
      [&](const Rows& out) { passThrough(machine, record.size(), options.substeps, input, out); }, recorded,
      record);
  return record;
}

Record simulate(const MachineModel& model, const CampaignTest& test, const Record* recorded, Record record,
                double phase, const SimulationOptions& options) {
  if (options.substeps < 1) throw Error("simulation: substeps below 1");
  CuttingMachine machine(model, 1.0 / (test.sample_rate * options.substeps), Feed::steady,
                         options.corner_slices);
  const std::optional<Guide> guide = guideOf(test, recorded, options, machine);
  if (guide) machine.guide();
  const auto simulated = [&] {
    return simulateOn(machine, model, test, recorded, std::move(record), phase, guide, options);
  };
  if (!options.traces || !(test.kind == TestKind::cut || machine.vibrates())) return simulated();
  // Where forces tell the place of the tip, the sensor and the tool's modes enter it.
  std::vector<double> values = guide && Guide::byForce(*recorded)
                                   ? valuesOfRecord(model, test.kind)
                                   : valuesOfTrace(model, test.kind, guide.has_value());
  if (const auto held = options.traces->find(values)) {
    machine.follow(held.get());
    return simulated();
  }
  const auto kept = std::make_shared<CutTrace>();
  machine.keep(kept.get());
  Record result = simulated();
  options.traces->hold(std::move(values), kept);
  return result;
}

}  // namespace

double recordedPhase(const CampaignTest& test, const Record& recorded) {
  if (test.kind == TestKind::tap || !recorded.has("spindle_angle")) return 0.0;
  const std::vector<double>& angle = recorded.column("spindle_angle");
  double s = 0.0, c = 0.0;
  for (std::size_t i = 0; i < angle.size(); ++i) {
    // On the grid of the sample rate, as the test is simulated.
    const double turned = test.spindle_speed * static_cast<double>(i) / test.sample_rate;
    s += std::sin(angle[i] - turned);
    c += std::cos(angle[i] - turned);
  }
  // A line of no whole order tells one turn from the next: the record's own count, 0..2 pi at its first
  // sample.
  return angle[0] + std::remainder(std::atan2(s, c) - angle[0], units::TWO_PI);
}

Record simulateTest(const MachineModel& model, const CampaignTest& test, const Record& recorded,
                    const SimulationOptions& options) {
  if (recorded.size() == 0) throw Error(recorded.file + ": no samples");
  Record record;
  record.file = recorded.file;
  // The grid of the sample rate; a file's times are rounded to its printed digits.
  for (std::size_t i = 0; i < recorded.size(); ++i)
    record.time.push_back(recorded.time[0] + static_cast<double>(i) / test.sample_rate);
  const auto asked = [&](const std::string& name) {
    return name == "hammer" || motionAxis(name) || !options.channels ||
           std::find(options.channels->begin(), options.channels->end(), name) != options.channels->end();
  };
  for (const std::string& name : recorded.names) {
    if (gives(name, test) && asked(name)) record.add(name) = recorded.column(name);
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
