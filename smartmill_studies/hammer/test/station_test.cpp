// The hammer sequence at the simulated station, whose physics is independent of the sequence.

#include "hammer/station_score.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "hammer/station_draw.h"
#include "hammer/station_machine.h"
#include "hammer/tap_scatter.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/world/hammer_station.h"
#include "smartmill_sim/world/tool_structure.h"

namespace smartmill::hammer {
namespace {

constexpr std::uint64_t SEED = 3;

/// The first random machine that fulfils a condition.
template <class Condition>
DrawnStation firstWith(Condition condition) {
  for (int number = 0;; ++number) {
    const DrawnStation drawn = drawStation(SEED, number);
    if (condition(drawn)) return drawn;
  }
}

TEST(Station, TheSameArgumentsGiveTheSameMachine) {
  const DrawnStation a = drawStation(5, 3), b = drawStation(5, 3), c = drawStation(5, 4);
  EXPECT_EQ(a.mounting, b.mounting);
  EXPECT_EQ(a.traits.spindle_frequency, b.traits.spindle_frequency);
  EXPECT_NE(a.mounting, c.mounting);
}

// Required for 95 % of the modes: 0.2 % of frequency, 6 % of damping; here for each of the few. Gain at the
// tip from hits about 15 mm above it: 3 % in the median, each within four standard deviations.
TEST(Station, MeasuresDrawnMachinesWithoutTouching) {
  const StationStudy study{SEED, 8};
  std::vector<double> tip;
  for (int number = 0; number < 4; ++number) {
    const nlohmann::json line = runStation(study, number);
    EXPECT_FALSE(line["touched"]) << number;
    ASSERT_FALSE(line["out_of_range"]) << number;
    ASSERT_EQ(line["code"], 0) << number << " " << line["message"];
    EXPECT_LT(line["moves"], line["thesis_moves"]) << number;
    EXPECT_LT(line["struck_retreat"], 0.3) << number;
    EXPECT_FALSE(line["modes"].empty());
    for (const nlohmann::json& mode : line["modes"]) {
      EXPECT_LT(std::abs(mode["f_error"].get<double>()), 2e-3) << number << " " << mode["f"];
      EXPECT_LT(std::abs(mode["zeta_error"].get<double>()), 6e-2) << number << " " << mode["f"];
      EXPECT_LT(std::abs(mode["tip_z"].get<double>()), 4.0) << number << " " << mode["f"];
      tip.push_back(std::abs(mode["k_tip"].get<double>()));
    }
  }
  EXPECT_LT(median(tip), 0.03);
}

// Thesis 7.1: with the sensor opposite the hammer the receptance at the hammer is measured itself. The gain
// at the tip, 1 to 3 mm below, is within 3 % in the median without any correction for an offset.
TEST(Station, TheSensorOppositeTheHammerMeasuresTheDirectReceptance) {
  const StationStudy study{SEED, 8, true};
  std::vector<double> tip;
  for (int number = 0; number < 4; ++number) {
    const nlohmann::json line = runStation(study, number);
    EXPECT_FALSE(line["touched"]) << number;
    ASSERT_EQ(line["code"], 0) << number << " " << line["message"];
    EXPECT_LT(line["struck_retreat"], 0.3) << number;
    for (const nlohmann::json& mode : line["modes"]) {
      EXPECT_LT(std::abs(mode["f_error"].get<double>()), 2e-3) << number << " " << mode["f"];
      tip.push_back(std::abs(mode["k_tip"].get<double>()));
    }
  }
  ASSERT_FALSE(tip.empty());
  EXPECT_LT(median(tip), 0.03);
}

// Stated and observed scatter of repeated measurements agree within a factor of 1.5.
TEST(Station, LinesScatterFromRunToRunAsTheyState) {
  const nlohmann::json line = tapScatter({SEED, 8}, 0, 5);
  ASSERT_EQ(line["runs"], 5);
  EXPECT_LT(line["scatter"], 1.5);
  EXPECT_GT(line["scatter"], 1.0 / 1.5);
}

// The tool has five unevenly spaced teeth and the flute found is not the first, so that the angles of the
// others are no more accurate.
TEST(Station, UnevenTeethOfWhichAnyMayBeTheFluteThatWasFound) {
  const nlohmann::json line = runStation({16, 3}, 157);
  EXPECT_FALSE(line["touched"]);
  EXPECT_GT(line["closest_um"], 100.0);
  EXPECT_EQ(line["code"], 0) << line["message"];
}

// Force along one axis, response across it: compared with the cross receptance of the station on lines where
// it exceeds ten standard deviations.
TEST(Station, TheCrossFrfIsThatOfTheStructure) {
  DrawnStation drawn = firstWith([](const DrawnStation& d) {
    return d.traits.cross_sensor && !d.out_of_range && d.traits.tooth == "flute";
  });
  drawn.traits.plane_turn = 0.6;
  drawn.traits.plane_ratio = 0.85;
  drawn.traits.bounce_chance = 0.0;
  StationMachine machine(drawn, 1);
  HammerParameters parameters;
  parameters.sensor_face = drawn.traits.housing;
  parameters.sensor_electrode = drawn.traits.electrode;
  double seconds = 0.0;
  const MeasureFrfResult result = measure(machine, parameters, drawn.believed, goalOf(drawn, 10), seconds);
  ASSERT_EQ(result.code, FrfCode::ok) << result.message;
  EXPECT_FALSE(machine.touched());
  ASSERT_GT(result.cross.frf.size(), 0u) << result.message;
  const std::size_t axis = drawn.direction == "x" ? 0 : 1;
  EXPECT_EQ(result.cross.direction, drawn.direction == "x" ? "xy" : "yx");
  const sim::HammerStation station(drawn.true_model, drawn.traits, 0.0, 1e-5);
  const ModalModel truth = station.measured(1 - axis, axis);
  double off = 0.0, all = 0.0;
  int lines = 0;
  for (std::size_t k = 0; k < result.cross.frf.size(); ++k) {
    const double f = result.cross.frf.frequency[k];
    if (f < 300.0 || f > 5000.0 || std::abs(truth.response(f)) < 10.0 * result.cross.frf.std_dev[k]) continue;
    ++lines;
    off += std::norm(result.cross.frf.value[k] - truth.response(f));
    all += std::norm(truth.response(f));
  }
  EXPECT_GT(lines, 10);
  EXPECT_LT(std::sqrt(off / all), 0.1);
}

// A station turned about z gives what the aligned one gives: the receptance along the machine's axis as near
// to that of the structure, its modes within their deviations; the cross receptance is that of the structure,
// whose principal planes are turned too.
TEST(Station, ATurnedStationGivesTheReceptancesAlongTheMachine) {
  DrawnStation drawn = firstWith([](const DrawnStation& d) {
    return d.traits.cross_sensor && !d.out_of_range && d.traits.tooth == "flute";
  });
  drawn.traits.plane_turn = 0.2;
  drawn.traits.plane_ratio = 0.85;
  drawn.traits.bounce_chance = 0.0;
  const std::size_t axis = drawn.direction == "x" ? 0 : 1;
  const sim::ToolStructure structure(drawn.traits, *drawn.believed.tool, *drawn.believed.stickout);
  const ModalModel along = structure.between(axis, 0.0, axis, 0.0),
                   across = structure.between(1 - axis, 0.0, axis, 0.0);
  const auto error = [](const FrequencyResponse& frf, const ModalModel& truth) {
    double off = 0.0, all = 0.0;
    for (std::size_t k = 0; k < frf.size(); ++k) {
      const double f = frf.frequency[k];
      if (f < 300.0 || f > 3500.0) continue;
      off += std::norm(frf.value[k] - truth.response(f));
      all += std::norm(truth.response(f));
    }
    return std::sqrt(off / all);
  };
  double aligned = 0.0;
  for (const double turn : {0.0, -30.0}) {
    const double half = 0.5 * units::radFromDeg(turn);
    for (MachineModel* model : {&drawn.true_model, &drawn.believed})
      model->frames["hammer"] = {"machine", {}, {{0.0, 0.0, std::sin(half), std::cos(half)}}};
    StationMachine machine(drawn, 1);
    HammerParameters parameters;
    parameters.sensor_face = drawn.traits.housing;
    parameters.sensor_electrode = drawn.traits.electrode;
    double seconds = 0.0;
    const MeasureFrfResult result = measure(machine, parameters, drawn.believed, goalOf(drawn, 10), seconds);
    ASSERT_EQ(result.code, FrfCode::ok) << turn << " deg: " << result.message;
    EXPECT_FALSE(machine.touched());
    EXPECT_EQ(result.frf.direction, drawn.direction);
    const double off = error(result.frf.frf, along);
    std::cout << turn << " deg, " << seconds << " s: " << result.message << "; error of the FRF " << off
              << ", of the cross FRF " << error(result.cross.frf, across) << "\n";
    if (turn == 0.0) {
      aligned = off;
      continue;
    }
    EXPECT_LT(off, 1.1 * aligned) << turn;
    EXPECT_LT(error(result.cross.frf, across), 0.25) << turn;
    int found = 0;
    for (const Mode& mode : result.modes.model.modes) {
      const auto truth =
          std::min_element(along.modes.begin(), along.modes.end(), [&](const Mode& a, const Mode& b) {
            return std::abs(a.frequency - mode.frequency) < std::abs(b.frequency - mode.frequency);
          });
      EXPECT_NEAR(mode.frequency, truth->frequency, 2e-3 * truth->frequency) << turn;
      EXPECT_LT(std::abs(mode.gain - truth->gain), 4.0 * mode.gain_std) << turn << " " << mode.frequency;
      EXPECT_LT(mode.gain_std, 0.15 * mode.gain) << turn << " " << mode.frequency;
      ++found;
      std::cout << mode.frequency << " Hz, " << 1e-6 / mode.gain << " N/um +- "
                << 100.0 * mode.gain_std / mode.gain << " % (truth " << truth->frequency << ", "
                << 1e-6 / truth->gain << ")\n";
    }
    EXPECT_GE(found, 2);
  }
}

TEST(Station, SaysThatNothingStandsThere) {
  const DrawnStation drawn = firstWith([](const DrawnStation& d) { return d.out_of_range; });
  StationMachine machine(drawn, 1);
  double seconds = 0.0;
  const MeasureFrfResult result =
      measure(machine, HammerParameters(), drawn.believed, goalOf(drawn, 3), seconds);
  EXPECT_EQ(result.code, FrfCode::no_flute) << result.message;
  EXPECT_EQ(machine.strikes(), 0);
  EXPECT_LT(seconds, 60.0);
}

// A sensor much too near or a tool much too large: the approach stops before contact.
TEST(Station, ATooLargeToolStopsBeforeTheSensor) {
  DrawnStation drawn = firstWith([](const DrawnStation& d) { return !d.out_of_range; });
  for (auto& [name, place] : drawn.true_model.hammer->position) {
    for (std::size_t axis = 0; axis < 2; ++axis) place[axis] -= 0.4e-3;
  }
  drawn.traits.cross_sensor = false;
  StationMachine machine(drawn, 1);
  double seconds = 0.0;
  const MeasureFrfResult result =
      measure(machine, HammerParameters(), drawn.believed, goalOf(drawn, 3), seconds);
  EXPECT_EQ(result.code, FrfCode::no_flute) << result.message;
  EXPECT_NE(result.message.find("too near"), std::string::npos) << result.message;
  EXPECT_EQ(machine.strikes(), 0);
  EXPECT_FALSE(machine.touched());
}

// A hammer that always bounces: the message states the reason.
TEST(Station, RefusedHitsEndTheMeasurementWithTheirReason) {
  DrawnStation drawn = firstWith([](const DrawnStation& d) { return !d.out_of_range; });
  drawn.traits.bounce_chance = 1.0;
  drawn.traits.bounce_share = 0.6;
  drawn.traits.bounce_delay = 3e-3;
  StationMachine machine(drawn, 1);
  HammerParameters parameters;
  parameters.max_bad_hits = 3;
  double seconds = 0.0;
  const MeasureFrfResult result = measure(machine, parameters, drawn.believed, goalOf(drawn, 3), seconds);
  EXPECT_EQ(result.code, FrfCode::no_hit) << result.message;
  EXPECT_NE(result.message.find("4 rejected hits"), std::string::npos) << result.message;
  EXPECT_NE(result.message.find("double"), std::string::npos) << result.message;
  EXPECT_EQ(machine.strikes(), 4);
}

// A cancel at any stage ends the measurement with the tool retracted.
TEST(Station, ACancelAtEveryStageRetracts) {
  const DrawnStation drawn =
      firstWith([](const DrawnStation& d) { return d.traits.cross_sensor && !d.out_of_range; });
  HammerParameters parameters;
  parameters.sensor_face = drawn.traits.housing;
  parameters.sensor_electrode = drawn.traits.electrode;
  std::size_t stages = 0;
  for (std::size_t stop_at = 0; stop_at <= stages; ++stop_at) {
    StationMachine machine(drawn, 1);
    HammerSequence sequence(parameters, drawn.believed);
    ASSERT_TRUE(sequence.handle(goalOf(drawn, 1)));
    StationMachine::Streams streams;
    std::vector<std::string> seen;
    std::optional<MeasureFrfResult> result;
    double last = 0.0, cancelled = 0.0;
    while (!result && machine.time() < 1200.0) {
      machine.block(streams);
      sequence.handle(streams.samples);
      sequence.handle(streams.state);
      sequence.handle(streams.angle);
      for (const Command& command : sequence.takeCommands()) machine.obey(command);
      if (const auto feedback = sequence.takeFeedback()) {
        if (cancelled == 0.0) {
          EXPECT_GE(feedback->progress, last - 1e-9) << feedback->stage;
        }
        last = feedback->progress;
        seen.push_back(feedback->stage);
        if (seen.size() == stop_at + 1 && cancelled == 0.0) {
          cancelled = machine.time();
          sequence.cancel(cancelled);
        }
      }
      result = sequence.takeResult();
    }
    ASSERT_TRUE(result) << stop_at;
    if (stop_at == 0) stages = 8;  // minimum number before the first hit
    if (result->code == FrfCode::ok) break;
    EXPECT_EQ(result->code, FrfCode::cancelled) << result->message;
    EXPECT_LT(machine.time() - cancelled, 15.0) << seen.back();
    EXPECT_FALSE(machine.touched());
    EXPECT_LT(streams.state.distance_to_go[2], 1e-9);
  }
}

}  // namespace
}  // namespace smartmill::hammer
