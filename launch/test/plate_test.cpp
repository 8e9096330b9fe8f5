// The six-channel plate of the simulated machine, tapped and calibrated by the actions of kalman_node.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <actionlib/client/simple_action_client.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/CalibrateForceSensorAction.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <smartmill_msgs/PanelKey.h>
#include <smartmill_msgs/SampleBlock.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace {

using smartmill_msgs::CalibrateForceSensorGoal;
using Calibrate = actionlib::SimpleActionClient<smartmill_msgs::CalibrateForceSensorAction>;
using Measure = actionlib::SimpleActionClient<smartmill_msgs::MeasureFrfAction>;
using Point = std::array<double, 3>;

constexpr double TIMEOUT = 120.0;  // [s] time limit on a busy computer
constexpr int HITS = 2;

class Plate : public testing::Test {
 protected:
  Plate()
      : calibrate(smartmill::names::CALIBRATE_SENSOR, true),
        measure(smartmill::names::MEASURE_SENSOR_FRF, true) {
    EXPECT_TRUE(calibrate.waitForServer(ros::Duration(TIMEOUT)));
    EXPECT_TRUE(measure.waitForServer(ros::Duration(TIMEOUT)));
  }

  smartmill_msgs::CalibrateForceSensorResult calibrationResult(CalibrateForceSensorGoal goal) {
    goal.header.stamp = ros::Time::now();
    calibrate.sendGoal(goal);
    EXPECT_TRUE(calibrate.waitForResult(ros::Duration(TIMEOUT)));
    return *calibrate.getResult();
  }

  /// Hits along an axis at a point of the workpiece, which is stated to the calibration first.
  void tap(const Point& at, const std::string& direction) {
    ros::ServiceClient hammer_position = nh.serviceClient<smartmill_msgs::PanelKey>("sim/panel/tap_point");
    ASSERT_TRUE(hammer_position.waitForExistence(ros::Duration(TIMEOUT)));
    smartmill_msgs::PanelKey key;
    key.request.values = {at[0], at[1], at[2]};
    ASSERT_TRUE(hammer_position.call(key));
    ASSERT_EQ(key.response.code, smartmill_msgs::PanelKey::Response::OK) << key.response.message;
    CalibrateForceSensorGoal point;
    point.step = point.POINT;
    point.point.x = at[0], point.point.y = at[1], point.point.z = at[2];
    ASSERT_EQ(calibrationResult(point).code, smartmill_msgs::CalibrateForceSensorResult::OK);
    smartmill_msgs::MeasureFrfGoal taps;
    taps.header.stamp = ros::Time::now();
    taps.point = "force_sensor";
    taps.direction = direction;
    taps.hits = HITS;
    measure.sendGoal(taps);
    ASSERT_TRUE(measure.waitForResult(ros::Duration(TIMEOUT)));
    ASSERT_EQ(measure.getResult()->code, smartmill_msgs::MeasureFrfResult::OK)
        << measure.getResult()->message;
  }

  ros::NodeHandle nh;
  Calibrate calibrate;
  Measure measure;
};

/// Largest mean over 0.5 ms of a stream [N].
class Peak {
 public:
  void add(double value) {
    window_.push_back(value);
    if (window_.size() > LENGTH) window_.erase(window_.begin());
    double sum = 0.0;
    for (const double v : window_) sum += v / LENGTH;
    value_ = std::max(value_, std::abs(sum));
  }
  double value() const { return value_; }

 private:
  static constexpr std::size_t LENGTH = 26;
  std::vector<double> window_;
  double value_ = 0.0;
};

TEST_F(Plate, MeasuresTheForceOfAHitAfterCalibrationAtSeveralPoints) {
  CalibrateForceSensorGoal fit;
  fit.step = fit.FIT;
  EXPECT_EQ(calibrationResult(fit).code,
            smartmill_msgs::CalibrateForceSensorResult::FIT_FAILED);  // nothing was tapped
  CalibrateForceSensorGoal invalid;
  invalid.step = invalid.POINT;
  invalid.point.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(calibrationResult(invalid).code, smartmill_msgs::CalibrateForceSensorResult::BAD_GOAL);

  const std::vector<std::pair<Point, const char*>> points{
      {{-0.03, -0.025, 0.03}, "z"}, {{-0.03, 0.025, 0.03}, "z"},  {{0.03, -0.025, 0.03}, "z"},
      {{0.03, 0.025, 0.03}, "z"},   {{0.045, -0.02, 0.012}, "x"}, {{0.045, 0.02, 0.028}, "x"},
      {{-0.02, -0.04, 0.028}, "y"}, {{0.02, -0.04, 0.012}, "y"}};
  for (const auto& [point, direction] : points) tap(point, direction);
  if (HasFatalFailure()) return;
  const smartmill::TemporaryFolder folder;
  fit.file = folder.file("plate.yaml");
  const auto found = calibrationResult(fit);
  ASSERT_EQ(found.code, found.OK) << found.message;
  EXPECT_EQ(found.readings, HITS * points.size());
  std::string format;
  std::getline(std::ifstream(fit.file) >> std::ws, format);
  EXPECT_EQ(format, "format: smartmill-taps/1");
  EXPECT_TRUE(std::ifstream(folder.file("plate_16.csv")).good());

  // At another point the compensated force equals that of the hammer.
  std::mutex mutex;
  Peak hammer, compensated, measured;
  std::array<Peak*, 2> peaks{{&compensated, &measured}};
  const auto addTo = [&](std::size_t which) {
    return [&, which](const smartmill_msgs::ForceBlock::ConstPtr& m) {
      const std::lock_guard<std::mutex> lock(mutex);
      for (const double f : m->fx) peaks[which]->add(f);
    };
  };
  const ros::Subscriber compensated_force =
      nh.subscribe<smartmill_msgs::ForceBlock>(smartmill::names::FORCE_COMPENSATED, 1000, addTo(0));
  const ros::Subscriber measured_force =
      nh.subscribe<smartmill_msgs::ForceBlock>(smartmill::names::FORCE_MEASURED, 1000, addTo(1));
  const ros::Subscriber hammer_force = nh.subscribe<smartmill_msgs::SampleBlock>(
      smartmill::names::HAMMER, 1000, [&](const smartmill_msgs::SampleBlock::ConstPtr& m) {
        const std::lock_guard<std::mutex> lock(mutex);
        const std::size_t n = m->channels.size();
        const auto c = static_cast<std::size_t>(std::find(m->channels.begin(), m->channels.end(), "hammer") -
                                                m->channels.begin());
        for (std::size_t i = c; i < m->samples.size(); i += n) hammer.add(m->samples[i]);
      });
  ros::Duration(0.5).sleep();
  tap({0.045, 0.0, 0.02}, "x");
  ros::Duration(0.5).sleep();
  const std::lock_guard<std::mutex> lock(mutex);
  ASSERT_GT(hammer.value(), 5.0);
  std::printf("%s; hit of %.2f N (mean of 0.5 ms): compensated %.2f N, measured %.2f N\n",
              found.message.c_str(), hammer.value(), compensated.value(), measured.value());
  EXPECT_NEAR(compensated.value(), hammer.value(), 0.03 * hammer.value());
  EXPECT_GT(std::abs(measured.value() - hammer.value()),
            2.0 * std::abs(compensated.value() - hammer.value()));
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "plate_test");
  ros::NodeHandle keep_ros_running;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  return RUN_ALL_TESTS();
}
