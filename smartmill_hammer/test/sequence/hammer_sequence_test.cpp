#include "smartmill_hammer/sequence/hammer_sequence.h"

#include <cmath>
#include <functional>
#include <iostream>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../closed_form_machine.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_hammer/sequence/hammer_pipeline.h"

namespace smartmill::hammer {
namespace {

MeasureFrfGoal goalFor(const std::string& direction, double stamp) {
  MeasureFrfGoal goal;
  goal.stamp = stamp;
  goal.tool = "mill";
  goal.point = POINT_TOOL_TIP;
  goal.direction = direction;
  goal.hits = 5;
  goal.modes = 2;
  goal.stickout = 51e-3;
  goal.teeth = 4;
  return goal;
}

/// The recorded streams.
struct Recording {
  std::vector<SampleBlock> blocks;
  std::vector<SpindleAngle> angles;
  std::vector<CncState> states;
  MeasureFrfGoal goal;
};

/// Runs a measurement on the machine, inputs in stamp order.
MeasureFrfResult measure(ClosedFormMachine& machine, HammerSequence& sequence, const MeasureFrfGoal& goal,
                         Recording* recording = nullptr,
                         const std::function<void(HammerSequence&, double)>& intervene = nullptr,
                         std::vector<std::string>* stages = nullptr) {
  if (recording) recording->goal = goal;
  EXPECT_TRUE(sequence.handle(goal));
  for (int i = 0; i < 20000; ++i) {
    SampleBlock block;
    SpindleAngle angle;
    CncState state;
    machine.block(block, angle, state);
    if (recording) {
      recording->blocks.push_back(block);
      recording->angles.push_back(angle);
      if (i % 2 == 0) recording->states.push_back(state);
    }
    sequence.handle(block);
    if (intervene) intervene(sequence, angle.stamp);
    if (i % 2 == 0) sequence.handle(state);
    sequence.handle(angle);
    for (const Command& c : sequence.takeCommands()) machine.obey(c);
    if (auto feedback = sequence.takeFeedback(); feedback && stages) stages->push_back(feedback->stage);
    if (auto result = sequence.takeResult()) return *result;
  }
  ADD_FAILURE() << "no result";
  return {};
}

bool retracted(const ClosedFormMachine& machine) {
  return machine.position[2] > 0.05 + 0.049;
}

// A required uncertainty that three hits reach ends the measurement there; an unreachable one takes all hits
// of the goal.
TEST(HammerSequence, StrikesAsOftenAsTheRequiredUncertaintyNeeds) {
  for (const double required : {0.5, 1e-6}) {
    ClosedFormMachine machine(1);
    HammerParameters parameters;
    parameters.asked_std = required;
    HammerSequence sequence(parameters, machine.model);
    const auto result = measure(machine, sequence, goalFor("x", machine.time));
    ASSERT_EQ(result.code, FrfCode::ok) << result.message;
    EXPECT_EQ(result.frf.frf.averages, required > 0.1 ? 3 : 5);
  }
}

// Required accuracy: modes within 0.5 % in frequency and 5 % in stiffness, through a sensor whose sensitivity
// varies by 5 % over the vibration, 2 mV of noise, an unknown mounting angle and a hammer 15 mm above the
// sensor.
TEST(HammerSequence, MeasuresTheToolTipInBothDirections) {
  ClosedFormMachine machine(1);
  HammerParameters parameters;
  parameters.sensor_face = parameters.sensor_electrode = 0.0;  // the machine's is a point
  HammerSequence sequence(parameters, machine.model);
  for (const std::string direction : {"x", "y"}) {
    std::vector<std::string> stages;
    const double began = machine.time;
    const auto result =
        measure(machine, sequence, goalFor(direction, machine.time), nullptr, nullptr, &stages);
    ASSERT_EQ(result.code, FrfCode::ok) << result.message;
    const ModalModel& truth = machine.tip[direction == "x" ? 0 : 1];
    ASSERT_EQ(result.modes.model.modes.size(), 2u);
    for (std::size_t k = 0; k < 2; ++k) {
      const Mode &mode = result.modes.model.modes[k], &expected = truth.modes[k];
      EXPECT_NEAR(mode.frequency, expected.frequency, 0.005 * expected.frequency);
      EXPECT_NEAR(mode.gain, expected.gain, 0.05 * expected.gain) << "mode " << k;  // positive
      EXPECT_NEAR(mode.damping_ratio, expected.damping_ratio, 0.1 * expected.damping_ratio);
      EXPECT_GT(mode.gain_std, 0.0);
      std::cout << direction << " mode " << k << ": " << mode.frequency << " Hz, zeta " << mode.damping_ratio
                << ", k " << 1e-6 / mode.gain << " N/um (truth " << 1e-6 / expected.gain << ", z "
                << (mode.gain - expected.gain) / mode.gain_std << ")\n";
    }
    EXPECT_EQ(result.frf.direction, direction);
    EXPECT_EQ(result.frf.frf.averages, 5);
    EXPECT_EQ(result.frf.frf.unit, "m/N");
    EXPECT_GT(result.frf.stamp, began);
    EXPECT_NEAR(result.sensitivity, 25e-6, 0.03 * 25e-6);
    EXPECT_TRUE(retracted(machine));
    // A flute faces the hammer: 15 mm above the tip, where the edges lag.
    const double facing = direction == "x" ? 0.5 * units::PI : 0.0;
    EXPECT_LT(machine.profile.retreat(result.flute_hammer + machine.mounting,
                                      machine.model.tool->lag() * 15e-3, facing),
              machine.profile.retreat(units::radFromDeg(4.0), 0.0, 0.0));
    EXPECT_GT(machine.closest, 0.4 * 250e-6);
    std::cout << direction << ": " << machine.time - began << " s of machine time, "
              << machine.commands.size() << " commands so far, sensitivity " << 1e6 * result.sensitivity
              << " um/V\n";
    EXPECT_GT(stages.size(), 8u);
  }
}

// Random cutters: thesis eq. 4.1 triples the angle error of one search; 3 x 1.5 degrees at worst.
TEST(HammerSequence, TurnsAFluteToTheHammerForAnyCutter) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int trial = 0; trial < 8; ++trial) {
    ClosedFormMachine machine(20u + static_cast<std::uint32_t>(trial));
    const int teeth = 2 + trial % 5;
    const double pitch = units::TWO_PI / teeth;
    machine.model.tool->teeth = teeth;
    machine.model.tool->diameter = (8.0 + 17.0 * uniform(random)) * 1e-3;
    machine.model.tool->helix = units::radFromDeg(45.0 * uniform(random));
    machine.model.stickout = 60e-3;
    machine.model.hammer->flute_depth = 1.5e-3;
    machine.mounting = units::TWO_PI * uniform(random);
    machine.profile =
        FluteProfile::even(teeth, (0.5 + uniform(random)) * 1e-3, (0.15 + 0.1 * uniform(random)) * pitch,
                           (0.15 + 0.1 * uniform(random)) * pitch);
    HammerSequence sequence(HammerParameters(), machine.model);
    auto goal = goalFor(trial % 2 ? "x" : "y", machine.time);
    goal.teeth = teeth;
    goal.stickout = 60e-3;
    goal.hits = 1;
    const auto result = measure(machine, sequence, goal);
    ASSERT_EQ(result.code, FrfCode::ok) << trial << " " << result.message;
    const double facing = trial % 2 ? 0.5 * units::PI : 0.0;
    const double lag = machine.model.tool->lag() * machine.model.hammer->offset;
    double off = 10.0;
    for (const double t : machine.profile.tooth_angle) {
      off =
          std::min(off, std::abs(nearAngle(result.flute_hammer + machine.mounting + t - lag - facing, 0.0)));
    }
    EXPECT_LT(units::degFromRad(off), 4.5) << trial;
  }
}

// Repeated measurements with different noise and position errors, not corrected for the offset. The first
// mode: aliasing of the sampled half sine changes the second one by up to 1 %, which no scatter contains.
TEST(HammerSequence, StandardDeviationOfStiffnessIsCalibrated) {
  Coverage gain;
  for (int run = 0; run < Coverage::FEW; ++run) {
    ClosedFormMachine machine(300u + static_cast<std::uint32_t>(run));
    machine.peak = 60.0;
    const HammerParameters parameters;
    machine.position_noise = parameters.position_std;
    HammerSequence sequence(parameters, machine.model);
    auto goal = goalFor("x", machine.time);
    goal.hits = 2;
    goal.stickout = 0.0;
    const auto result = measure(machine, sequence, goal);
    ASSERT_EQ(result.code, FrfCode::ok) << result.message;
    const Mode& mode = result.modes.model.modes[0];
    gain.add(mode.gain - machine.crossModel(0, 0.0).modes[0].gain, mode.gain_std);
  }
  EXPECT_TRUE(gain.isCalibrated(0.0, Coverage::FACTOR_OF_FEW));
}

// The same streams, cut into other blocks and sorted from another order of arrival, give the same digits.
TEST(HammerSequence, ReplayIsBitIdentical) {
  ClosedFormMachine machine(5);
  HammerSequence live(HammerParameters(), machine.model);
  Recording recording;
  const auto first = measure(machine, live, goalFor("x", machine.time), &recording);
  ASSERT_EQ(first.code, FrfCode::ok) << first.message;

  for (const std::size_t chunk : {256u, 128u, 512u}) {
    for (const std::uint32_t seed : {1u, 2u}) {
      HammerSequence replay(HammerParameters(), machine.model);
      StreamSorter sorter(0.05);
      const auto blocks = sorter.addRegular("daq/hammer"), states = sorter.addRegular("cnc/state"),
                 angles = sorter.addRegular("spindle/angle"), goals = sorter.addEvents("goal");
      struct Arrival {
        double when;
        std::function<void()> push;
      };
      std::vector<Arrival> arrivals;
      std::mt19937 random(seed);
      std::uniform_real_distribution<double> delay(0.0, 0.03);
      std::optional<MeasureFrfResult> result;
      const auto drain = [&] {
        replay.takeCommands();  // not executed
        if (auto r = replay.takeResult()) result = r;
      };
      // Each stream keeps its order, but they overtake each other.
      double last = 0.0;
      const auto arrive = [&](double stamp, std::function<void()> push) {
        last = std::max(last, stamp + delay(random));
        arrivals.push_back({last, std::move(push)});
      };
      std::vector<SampleBlock> cut;
      SampleBlock all = recording.blocks.front();
      all.samples.clear();
      for (const SampleBlock& b : recording.blocks)
        all.samples.insert(all.samples.end(), b.samples.begin(), b.samples.end());
      for (std::size_t i = 0; i + chunk <= all.size(); i += chunk) {
        SampleBlock b = recording.blocks.front();
        b.first_index += i;
        b.stamp = std::round((all.stamp + static_cast<double>(i) / all.sample_rate) * 1e9) * 1e-9;
        b.samples.assign(all.samples.begin() + static_cast<std::ptrdiff_t>(2 * i),
                         all.samples.begin() + static_cast<std::ptrdiff_t>(2 * (i + chunk)));
        cut.push_back(std::move(b));
      }
      arrivals.reserve(10000);
      arrive(recording.goal.stamp, [&, goals] {
        sorter.push(goals, recording.goal.stamp, [&] { replay.handle(recording.goal); });
      });
      last = 0.0;
      for (const auto& b : cut) {
        arrive(b.stamp + static_cast<double>(chunk) / 25600.0,
               [&, blocks] { sorter.push(blocks, b.stamp, [&] { replay.handle(b), drain(); }); });
      }
      last = 0.0;
      for (const auto& s : recording.states) {
        arrive(s.stamp, [&, states] { sorter.push(states, s.stamp, [&] { replay.handle(s), drain(); }); });
      }
      last = 0.0;
      for (const auto& a : recording.angles) {
        arrive(a.stamp, [&, angles] { sorter.push(angles, a.stamp, [&] { replay.handle(a), drain(); }); });
      }
      std::stable_sort(arrivals.begin(), arrivals.end(),
                       [](const Arrival& a, const Arrival& b) { return a.when < b.when; });
      for (const Arrival& a : arrivals) a.push();
      sorter.flush();
      ASSERT_TRUE(result.has_value()) << "chunk " << chunk;
      ASSERT_EQ(result->code, FrfCode::ok) << result->message;
      EXPECT_EQ(sorter.late(), 0u);
      EXPECT_EQ(result->sensitivity, first.sensitivity);
      EXPECT_EQ(result->flute_hammer, first.flute_hammer);
      ASSERT_EQ(result->frf.frf.size(), first.frf.frf.size());
      for (std::size_t k = 0; k < first.frf.frf.size(); ++k) {
        ASSERT_EQ(result->frf.frf.value[k], first.frf.frf.value[k]) << k;
        ASSERT_EQ(result->frf.frf.std_dev[k], first.frf.frf.std_dev[k]) << k;
      }
      for (std::size_t k = 0; k < first.modes.model.modes.size(); ++k) {
        EXPECT_EQ(result->modes.model.modes[k].frequency, first.modes.model.modes[k].frequency);
        EXPECT_EQ(result->modes.model.modes[k].gain_std, first.modes.model.modes[k].gain_std);
      }
      EXPECT_NEAR(result->frf.stamp, first.frf.stamp, 1e-8);
    }
  }
}

TEST(HammerSequence, RejectsDoubleHitsAndRepeatsThem) {
  ClosedFormMachine machine(6);
  HammerSequence sequence(HammerParameters(), machine.model);
  machine.each_block = [](ClosedFormMachine& m) { m.double_hit = m.strikes == 3; };
  std::vector<std::string> stages;
  const auto result = measure(machine, sequence, goalFor("x", machine.time), nullptr, nullptr, &stages);
  ASSERT_EQ(result.code, FrfCode::ok) << result.message;
  EXPECT_EQ(machine.strikes, 10);  // with the trial hit and three at the second height
  EXPECT_EQ(result.frf.frf.averages, 5);
  EXPECT_TRUE(std::any_of(stages.begin(), stages.end(),
                          [](const std::string& s) { return s.find("double hit") != std::string::npos; }));
}

TEST(HammerSequence, ToleratesOneNaNAndEndsOnMany) {
  {
    ClosedFormMachine machine(7);
    HammerSequence sequence(HammerParameters(), machine.model);
    int blocks = 0;
    machine.each_block = [&](ClosedFormMachine& m) { m.nan_sample = ++blocks % 900 == 0; };
    EXPECT_EQ(measure(machine, sequence, goalFor("x", machine.time)).code, FrfCode::ok);
  }
  ClosedFormMachine machine(7);
  HammerSequence sequence(HammerParameters(), machine.model);
  machine.each_block = [](ClosedFormMachine& m) { m.nan_sample = true; };
  const auto result = measure(machine, sequence, goalFor("x", machine.time));
  EXPECT_EQ(result.code, FrfCode::bad_data) << result.message;
  EXPECT_NE(result.message.find("not a number"), std::string::npos) << result.message;
  EXPECT_TRUE(retracted(machine));
}

std::string refusalOf(const HammerParameters& parameters, const MachineModel& model) {
  try {
    const HammerSequence sequence(parameters, model);
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

// The receptance along an axis of the machine needs both directions of a turned station and the second
// sensor.
TEST(HammerSequence, StatesWhatATurnedStationLacks) {
  MachineModel model = ClosedFormMachine(1).model;
  const double half = 0.125 * units::PI;
  model.frames["hammer"] = {"machine", {{0, 0, 0}}, {{0.0, 0.0, std::sin(half), std::cos(half)}}};
  EXPECT_EQ(refusalOf({}, model), "");
  HammerParameters without_cross;
  without_cross.cross_frf = 0;
  EXPECT_THAT(refusalOf(without_cross, model), ::testing::HasSubstr("cross_frf 0: frames.hammer of"));
  MachineModel one_direction = model;
  one_direction.hammer->position.erase("y");
  EXPECT_THAT(refusalOf({}, one_direction), ::testing::HasSubstr("expected hammer.position_mm of x and y"));
  MachineModel tilted = model;
  tilted.frames["hammer"].rotation = {{std::sin(0.01), 0.0, 0.0, std::cos(0.01)}};
  EXPECT_THAT(refusalOf({}, tilted), ::testing::HasSubstr("frames.hammer is tilted by 1.15 deg"));

  ClosedFormMachine machine(7);
  machine.model.frames["hammer"] = model.frames["hammer"];
  machine.station_turn = 0.25 * units::PI;
  HammerSequence sequence(HammerParameters(), machine.model);
  const auto result = measure(machine, sequence, goalFor("x", machine.time));
  EXPECT_EQ(result.code, FrfCode::bad_data) << result.message;
  EXPECT_THAT(result.message, ::testing::HasSubstr("expected the channel gap_cross")) << result.message;
}

TEST(HammerSequence, StatesThatThereIsNoToolOrNoHammer) {
  {
    ClosedFormMachine machine(8);
    machine.tool_present = false;
    HammerSequence sequence(HammerParameters(), machine.model);
    const auto result = measure(machine, sequence, goalFor("y", machine.time));
    EXPECT_EQ(result.code, FrfCode::no_flute) << result.message;
    EXPECT_TRUE(retracted(machine));
  }
  ClosedFormMachine machine(8);
  machine.no_hammer = true;
  HammerSequence sequence(HammerParameters(), machine.model);
  const auto result = measure(machine, sequence, goalFor("x", machine.time));
  EXPECT_EQ(result.code, FrfCode::no_hit) << result.message;
  EXPECT_TRUE(retracted(machine));
}

TEST(HammerSequence, CancelRetractsAtAnyStep) {
  for (const double after : {0.1, 1.0, 3.0, 6.0, 9.0, 12.0}) {
    ClosedFormMachine machine(9);
    HammerSequence sequence(HammerParameters(), machine.model);
    const double begin = machine.time;
    bool sent = false;
    const auto result =
        measure(machine, sequence, goalFor("x", begin), nullptr, [&](HammerSequence& s, double now) {
          if (!sent && now > begin + after) {
            s.cancel(now);
            sent = true;
          }
        });
    EXPECT_EQ(result.code, FrfCode::cancelled) << after << " " << result.message;
    EXPECT_TRUE(machine.position[2] > 0.0989) << after;
    EXPECT_FALSE(sequence.isActive());
  }
}

TEST(HammerSequence, AlarmEndsWithoutAMove) {
  ClosedFormMachine machine(10);
  HammerSequence sequence(HammerParameters(), machine.model);
  const double begin = machine.time;
  machine.each_block = [&](ClosedFormMachine& m) { m.alarm = m.time > begin + 7.0; };
  const auto result = measure(machine, sequence, goalFor("x", begin));
  EXPECT_EQ(result.code, FrfCode::motion_failed);
  EXPECT_NE(result.message.find("SV0417"), std::string::npos) << result.message;
  EXPECT_NE(result.message.find("by hand"), std::string::npos) << result.message;
  EXPECT_EQ(machine.commands.back().kind, Command::Kind::stop);
}

TEST(HammerSequence, FailedCommandAndLostStreamEnd) {
  ClosedFormMachine machine(12);
  HammerSequence sequence(HammerParameters(), machine.model);
  const double begin = machine.time;
  bool sent = false;
  auto result = measure(machine, sequence, goalFor("x", begin), nullptr, [&](HammerSequence& s, double now) {
    if (!sent && now > begin + 5.0) s.commandFailed(now, "cnc/jog: LIMIT: x beyond 0.5 m"), sent = true;
  });
  EXPECT_EQ(result.code, FrfCode::motion_failed);
  EXPECT_EQ(result.message.rfind("cnc/jog: LIMIT", 0), 0u) << result.message;
  EXPECT_TRUE(retracted(machine));

  const double again = machine.time;
  sent = false;
  result = measure(machine, sequence, goalFor("x", again), nullptr, [&](HammerSequence& s, double now) {
    if (!sent && now > again + 5.0) s.inputLost(now, "daq/hammer is silent for 1 s"), sent = true;
  });
  EXPECT_EQ(result.code, FrfCode::bad_data);
  EXPECT_NE(result.message.find("daq/hammer is silent"), std::string::npos) << result.message;
  EXPECT_EQ(machine.commands.back().kind, Command::Kind::move);
}

TEST(HammerSequence, RefusesBadGoalsAndNotArmed) {
  ClosedFormMachine machine(13);
  HammerSequence sequence(HammerParameters(), machine.model);
  const auto code = [&](MeasureFrfGoal goal) {
    EXPECT_TRUE(sequence.handle(goal));
    const auto r = sequence.takeResult();
    EXPECT_TRUE(r.has_value());
    EXPECT_FALSE(r && r->message.empty());
    return r ? r->code : FrfCode::ok;
  };
  auto goal = goalFor("z", machine.time);
  EXPECT_EQ(code(goal), FrfCode::bad_goal);
  goal = goalFor("x", machine.time);
  goal.hits = 0;
  EXPECT_EQ(code(goal), FrfCode::bad_goal);
  goal = goalFor("x", machine.time);
  goal.stickout = 10e-3;
  EXPECT_EQ(code(goal), FrfCode::bad_goal);
  goal = goalFor("x", machine.time);
  goal.point = POINT_FORCE_SENSOR;
  EXPECT_EQ(code(goal), FrfCode::bad_goal);
  machine.armed = false;
  const auto result = measure(machine, sequence, goalFor("x", machine.time));
  EXPECT_EQ(result.code, FrfCode::motion_failed);
  EXPECT_EQ(result.message, "motion is not armed");
  EXPECT_TRUE(machine.commands.empty());
}

TEST(HammerSequence, OneMeasurementAtATime) {
  ClosedFormMachine machine(14);
  HammerSequence sequence(HammerParameters(), machine.model);
  EXPECT_TRUE(sequence.handle(goalFor("x", machine.time)));
  EXPECT_FALSE(sequence.handle(goalFor("y", machine.time)));
}

TEST(HammerPipeline, ABackwardJumpOfTimeResetsAndALateCancelIsIgnored) {
  ClosedFormMachine machine(4), again(4);
  int restarts = 0, results = 0;
  std::vector<Command> commands;
  HammerPipeline pipeline(HammerParameters(), machine.model, 0.05,
                          {[&](const Command& c) { commands.push_back(c); },
                           {},
                           [&](const MeasureFrfResult&) { ++results; },
                           [&] { ++restarts; }});
  const auto run = [&](ClosedFormMachine& m, double seconds) {
    for (const double end = m.time + seconds; m.time < end;) {
      SampleBlock block;
      SpindleAngle angle;
      CncState state;
      m.block(block, angle, state);
      pipeline.push(block);
      pipeline.push(state);
      pipeline.push(angle);
    }
  };
  run(machine, 2.0);
  pipeline.push(goalFor("x", machine.time));
  run(machine, 1.0);
  EXPECT_TRUE(pipeline.isMeasuring());
  EXPECT_FALSE(commands.empty());
  run(again, 0.1);
  EXPECT_EQ(restarts, 1);
  EXPECT_FALSE(pipeline.isMeasuring());
  pipeline.cancel([] { return true; });
  pipeline.push(goalFor("x", again.time), [](bool free) { return !free; });  // refused
  run(again, 1.0);
  EXPECT_FALSE(pipeline.isMeasuring());
  EXPECT_EQ(results, 0);
  EXPECT_EQ(pipeline.lateMessages(), 0u);
}

TEST(HammerParameters, ErrorsNameTheKey) {
  HammerParameters p;
  p.least_jog = 1e-6;
  try {
    p.validate();
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("least_jog"), std::string::npos) << error.what();
  }
}

TEST(MoveProgram, IsIncrementalInMillimetres) {
  EXPECT_EQ(moveProgram({0.2, 0.1, 0.1},
                        {{{0.2, 0.1, 0.15}, 0.0}, {{0.295, 0.1, 0.05}, 0.01}, {{0.295, 0.1, 0.05}, 0.01}}),
            "G91\nG0 Z50.0000\nG1 X95.0000 Z-100.0000 F600.0\nG90\n");
}

}  // namespace
}  // namespace smartmill::hammer
