// A short session with the force sensor in the spindle, and one with the plate: calibrated by the session,
// compared with the true force of the simulated machine; replay and offline tools give the forces of the live
// node.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "launched.h"
#include "report/session_bag.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace {

using smartmill::TemporaryFolder;
using namespace smartmill::testing;
using namespace smartmill::report;
using Json = nlohmann::json;

constexpr double SETTLE = 10.0;  // [1] revolutions after which the compensation has settled, as in the report

/// [1] RMS error of the force: the documents' 5 %. The spindle sensor misses it at the dynamometer's
/// resonance (8 to 10 %), where a quarter of the error as measured is required; it meets it in the slots (1.0
/// to 2.2 %), the plate in all cuts (0.5 to 1.0 % in the slots, 3.3 % at the resonance: content above its
/// bandwidth).
constexpr double TARGET = 0.05, LARGEST_SHARE = 0.25;

/// [1] RMS of the difference from the true force over that of the true force, all axes together.
double forceError(const RecordedCut& cut, const ForceTrack& track) {
  const auto [from, to] = evaluatedSamples(cut, SETTLE);
  if (from == to) return NAN;
  double wrong = 0.0, all = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<double> truth = cut.truth.axis(axis, from, to);
    std::vector<double> difference = track.axis(axis, from, to);
    for (std::size_t i = 0; i < truth.size(); ++i) difference[i] -= truth[i];
    wrong += std::pow(smartmill::rms(difference), 2);
    all += std::pow(smartmill::rms(truth), 2);
  }
  return std::sqrt(wrong / all);
}

class SensorSession : public testing::TestWithParam<std::string> {};

TEST_P(SensorSession, IsCalibratedAndItsBagGivesTheSameForces) {
  const std::string& sensor = GetParam();
  const TemporaryFolder folder;
  setenv("ROS_HOSTNAME", "localhost", 1);
  setenv("ROS_HOME", folder.file("ros_home").c_str(), 1);
  const std::string live = folder.file("live.bag"), again = folder.file("again.bag");
  const std::string summary = folder.file("session.json"), log = folder.file("log.txt");
  run("roslaunch -p " + freePort() + " " SHORT_SESSION " sensor:=" + sensor + " port:=" + freePort() +
          " bag:=" + live + " summary:=" + summary,
      log);
  const Json json = Json::parse(contentOf(summary), nullptr, false);
  ASSERT_TRUE(!json.is_discarded() && json.value("completed", false)) << contentOf(log);
  const Json& state = json["force_sensor"];
  EXPECT_EQ(state["sensor"], sensor);
  EXPECT_TRUE(state["calibrated"].get<bool>());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double std_dev = state["constant_std"][axis], constant = state["constant"][axis];
    EXPECT_GT(std_dev, 0.0);
    EXPECT_LT(std_dev, 0.05 * std::abs(constant));
    EXPECT_LT(state["expected_error"][axis].get<double>(), 0.05);  // Burzoni 3.2.1
  }

  const SessionRecording recording = readSession(live, {});
  ASSERT_FALSE(recording.cuts.empty());
  for (const RecordedCut& cut : recording.cuts) {
    const double compensated = forceError(cut, cut.compensated), raw = forceError(cut, cut.raw);
    std::printf("%s, %s: RMS error compensated %.2f %%, as measured %.2f %%\n", sensor.c_str(),
                cut.condition.name.c_str(), 100.0 * compensated, 100.0 * raw);
    const bool missed = sensor == "spindle" && cut.condition.name.rfind("slot", 0) != 0;
    EXPECT_LT(compensated, missed ? LARGEST_SHARE * raw : TARGET) << cut.condition.name;
  }

  run("roslaunch -p " + freePort() + " smartmill_launch replay.launch rate:=0 sensor:=" + sensor +
          " bag:=" + live + " out:=" + again,
      log);
  const std::string replayed = contentOf(log);
  const int code = run("rosrun smartmill_launch compare_bags " + live + " " + again, log);
  const std::string verdict = contentOf(log);
  EXPECT_EQ(code, 0) << verdict << replayed;
  for (const char* topic : {"material/coefficients", "force/measured", "force/compensated"}) {
    const std::size_t line = verdict.find(topic);
    ASSERT_NE(line, std::string::npos) << verdict;
    EXPECT_EQ(verdict.substr(line, 80).find(" 0 common"), std::string::npos) << verdict;
  }
  run("rosrun smartmill_launch offline " + live + " --least-ratio 0 --sensor " + sensor + " -o " +
          folder.file("offline"),
      log);
  const std::string offline = contentOf(log);
  const std::size_t line = offline.find("compensate ");
  ASSERT_NE(line, std::string::npos) << offline;
  EXPECT_NE(offline.substr(line, 200).find("same in all printed digits"), std::string::npos) << offline;
}

INSTANTIATE_TEST_SUITE_P(Sensors, SensorSession, testing::Values("spindle", "plate"),
                         [](const auto& tested) { return tested.param; });

TEST(Sensor, AnUnknownOneIsRefusedByALineWithTheAllowedWords) {
  const TemporaryFolder folder;
  setenv("ROS_HOME", folder.file("ros_home").c_str(), 1);
  const std::string log = folder.file("log.txt");
  EXPECT_NE(run("roslaunch -p " + freePort() + " smartmill_launch pipeline.launch sensor:=dynamometer", log),
            0);
  const std::string text = contentOf(log);
  EXPECT_NE(text.find("sensor: dynamometer, expected table, spindle or plate"), std::string::npos) << text;
}

}  // namespace
