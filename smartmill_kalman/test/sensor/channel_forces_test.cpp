#include "smartmill_kalman/sensor/channel_forces.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"

namespace smartmill::kalman {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

using Vector = std::array<double, 3>;

constexpr double A = 0.03, B = 0.0575;  // [m] half distances of the four sensors
constexpr double PC_PER_N[3] = {-7.8, -7.8, -3.8};

/// The section of a model file for a table dynamometer of eight channels [pC].
const std::string KISTLER =
    "force_sensor:\n  noise_rms_n: [1, 1, 1]\n  channels:\n    arrangement: kistler_8\n"
    "    distance_x_mm: 30\n    distance_y_mm: 57.5\n    unit: pC\n"
    "    n_per_unit: [-0.12820512820512822, -0.12820512820512822, -0.26315789473684209]\n    noise_rms: "
    "0.5\n";

MachineModel modelOf(const std::string& section) {
  const TemporaryFolder folder;
  folder.write("model.yaml", "format: smartmill-model/1\n" + section);
  return readMachineModel(folder.file("model.yaml"));
}

SensorChannels channelsOf(const std::string& section) {
  return modelOf(section).force_sensor.channels.value();
}

SampleBlock blockOf(const std::vector<std::string>& channels, const std::string& unit,
                    const std::vector<double>& samples) {
  SampleBlock block;
  block.stamp = 10.0;
  block.sample_rate = 10000.0;
  block.first_index = 77;
  block.channels = channels;
  block.units.assign(channels.size(), unit);
  block.samples = samples;
  return block;
}

const std::vector<std::string> EIGHT{"fx12", "fx34", "fy14", "fy23", "fz1", "fz2", "fz3", "fz4"};

/// Charges of the eight channels for forces [N] on sensors 1 to 4.
std::vector<double> charges(const std::array<Vector, 4>& f) {
  return {PC_PER_N[0] * (f[0][0] + f[1][0]),
          PC_PER_N[0] * (f[2][0] + f[3][0]),
          PC_PER_N[1] * (f[0][1] + f[3][1]),
          PC_PER_N[1] * (f[1][1] + f[2][1]),
          PC_PER_N[2] * f[0][2],
          PC_PER_N[2] * f[1][2],
          PC_PER_N[2] * f[2][2],
          PC_PER_N[2] * f[3][2]};
}

// The sums that the manufacturer states for a dynamometer of four three-component sensors.
TEST(ChannelForces, EightChannelsFollowTheClosedForm) {
  const ChannelForces sensor(channelsOf(KISTLER));
  EXPECT_NEAR(sensor.condition(), B / A, 1e-9);  // of the moments about x and y
  // Sums of 2, 2 and 4 channels, and their levers.
  const double noise[6] = {
      std::sqrt(2.0) / 7.8, std::sqrt(2.0) / 7.8, 2.0 / 3.8,
      2.0 * B / 3.8,        2.0 * A / 3.8,        std::sqrt(2.0 * (A * A + B * B)) / 7.8};
  for (std::size_t c = 0; c < 6; ++c) EXPECT_NEAR(sensor.deviations().at(c), 0.5 * noise[c], 1e-9);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, 100.0);
  for (int run = 0; run < 20; ++run) {
    // Any distribution over the sensors, with internal forces as well.
    std::array<Vector, 4> f;
    for (Vector& one : f) {
      for (double& component : one) component = normal(random);
    }
    const SampleBlock out = sensor.forces(blockOf(EIGHT, "pC", charges(f)));
    EXPECT_EQ(out.channels, (std::vector<std::string>{"fx", "fy", "fz", "mx", "my", "mz"}));
    EXPECT_EQ(out.units, (std::vector<std::string>{"N", "N", "N", "N m", "N m", "N m"}));
    EXPECT_EQ(out.first_index, 77u);
    const double fx12 = f[0][0] + f[1][0], fx34 = f[2][0] + f[3][0], fy14 = f[0][1] + f[3][1],
                 fy23 = f[1][1] + f[2][1];
    EXPECT_NEAR(out.at(0, 0), fx12 + fx34, 1e-9);
    EXPECT_NEAR(out.at(0, 1), fy14 + fy23, 1e-9);
    EXPECT_NEAR(out.at(0, 2), f[0][2] + f[1][2] + f[2][2] + f[3][2], 1e-9);
    EXPECT_NEAR(out.at(0, 3), B * (f[0][2] + f[1][2] - f[2][2] - f[3][2]), 1e-9);
    EXPECT_NEAR(out.at(0, 4), A * (-f[0][2] + f[1][2] + f[2][2] - f[3][2]), 1e-9);
    EXPECT_NEAR(out.at(0, 5), B * (-fx12 + fx34) + A * (fy14 - fy23), 1e-9);
  }
}

// A force at a point gives its moment r x F about the origin, also above the plane of the sensors.
TEST(ChannelForces, AForceGivesItsMomentAboutTheOrigin) {
  SensorChannels raised = channelsOf(KISTLER);
  constexpr double HEIGHT = -0.02;  // [m] the sensors are below the origin
  for (SensorChannel& channel : raised.channels) channel.position[2] = HEIGHT;
  const ChannelForces sensor(raised);
  const Vector force{{120.0, -80.0, -300.0}}, at{{0.011, -0.023, 0.007}};
  // Rigid plate on equal sensors: lateral force in equal parts and by the moment about z, vertical by those
  // about x and y; the moments about the plane of the sensors.
  const double up = at[2] - HEIGHT;
  const Vector moment{{at[1] * force[2] - up * force[1], up * force[0] - at[0] * force[2],
                       at[0] * force[1] - at[1] * force[0]}};
  const double x[4] = {A, -A, -A, A}, y[4] = {B, B, -B, -B};
  std::array<Vector, 4> f;
  for (std::size_t i = 0; i < 4; ++i) {
    const double turn = moment[2] / (4.0 * (A * A + B * B));
    f[i] = {force[0] / 4.0 - turn * y[i], force[1] / 4.0 + turn * x[i],
            force[2] / 4.0 + moment[0] * y[i] / (4.0 * B * B) - moment[1] * x[i] / (4.0 * A * A)};
  }
  const SampleBlock out = sensor.forces(blockOf(EIGHT, "pC", charges(f)));
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(out.at(0, c), force[c], 1e-9);
  EXPECT_NEAR(out.at(0, 3), at[1] * force[2] - at[2] * force[1], 1e-9);
  EXPECT_NEAR(out.at(0, 4), at[2] * force[0] - at[0] * force[2], 1e-9);
  EXPECT_NEAR(out.at(0, 5), at[0] * force[1] - at[1] * force[0], 1e-9);
}

// A measured response of five channels to three forces: least squares finds the forces, and of noise the
// stated deviation.
TEST(ChannelForces, AMeasuredResponseIsInvertedByLeastSquares) {
  const double response[5][3] = {
      {1.0, 0.1, 0.0}, {0.0, 1.2, 0.1}, {0.2, 0.0, 0.9}, {0.5, 0.5, 0.1}, {0.0, 0.3, 0.8}};
  SensorChannels channels;
  channels.unit = "V";
  channels.components = 3;
  channels.noise_rms = 0.01;
  std::vector<std::string> names;
  for (int c = 0; c < 5; ++c) {
    SensorChannel channel;
    channel.name = names.emplace_back("s" + std::to_string(c));
    channel.response.assign(response[c], response[c] + 3);
    channels.channels.push_back(channel);
  }
  const ChannelForces sensor(channels);
  ASSERT_EQ(sensor.deviations().size(), 3u);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const Vector force{{3.0, -2.0, 5.0}};
  std::array<Coverage, 3> coverage;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    std::vector<double> samples;
    for (const auto& row : response) {
      samples.push_back(row[0] * force[0] + row[1] * force[1] + row[2] * force[2] +
                        (run == 0 ? 0.0 : 0.01 * normal(random)));
    }
    const SampleBlock out = sensor.forces(blockOf(names, "V", samples));
    for (std::size_t c = 0; c < 3; ++c) {
      if (run == 0) {
        EXPECT_NEAR(out.at(0, c), force[c], 1e-12);
      }
      coverage[c].add(out.at(0, c) - force[c], sensor.deviations()[c]);
    }
  }
  for (const Coverage& c : coverage) EXPECT_TRUE(c.isCalibrated());
}

TEST(ChannelForces, RefusesChannelsThatDoNotDetermineTheComponents) {
  const auto forces = [](const std::string& list, int components) {
    return ChannelForces(channelsOf("force_sensor:\n  channels:\n    components: " +
                                    std::to_string(components) + "\n    list:\n" + list));
  };
  const std::string x = "    - {name: a, direction: [1, 0, 0]}\n",
                    y = "    - {name: b, direction: [0, 1, 0]}\n",
                    nearly_y = "    - {name: c, direction: [0, 1, 0.02]}\n";
  EXPECT_THAT(
      [&] { forces(x + y + nearly_y, 3); },
      ThrowsMessage<Error>(HasSubstr("force_sensor.channels: condition number 100 of 3 components from 3 "
                                     "channels, expected at most 30")));
  EXPECT_THAT([&] { forces(x + y + "    - {name: c, direction: [1, 1, 0]}\n", 3); },
              ThrowsMessage<Error>(HasSubstr("condition number inf")));
  EXPECT_THAT([&] { forces(x + y, 3); }, ThrowsMessage<Error>(HasSubstr("2 channels, expected at least 3")));
  EXPECT_THAT([&] { forces(x + y + x, 3); }, ThrowsMessage<Error>(HasSubstr("channel a occurs twice")));
  EXPECT_THAT([&] { forces(x + y + "    - {name: c, direction: [0, 0, 0]}\n", 3); },
              ThrowsMessage<Error>(HasSubstr("direction: has length 0")));
  EXPECT_THAT([&] { forces(x + y + "    - {name: c, response: [0, 0, 1]}\n", 3); },
              ThrowsMessage<Error>(HasSubstr("expected response for all channels or for none")));
  EXPECT_THAT([&] { forces(x + y + nearly_y, 4); },
              ThrowsMessage<Error>(HasSubstr("components: 4, expected 3")));
  EXPECT_THAT(
      [&] { channelsOf("force_sensor:\n  channels:\n    arrangement: kistler_8\n    distance_x_mm: 0\n"); },
      ThrowsMessage<Error>(HasSubstr("force_sensor.channels.distance_x_mm")));
}

TEST(ChannelForces, IsWrittenAndReadBack) {
  const MachineModel model = modelOf(KISTLER);
  const TemporaryFolder folder;
  writeMachineModel(model, folder.file("again.yaml"));
  const SensorChannels before = *model.force_sensor.channels,
                       after = readMachineModel(folder.file("again.yaml")).force_sensor.channels.value();
  ASSERT_EQ(after.channels.size(), 8u);
  EXPECT_EQ(after.unit, "pC");
  EXPECT_EQ(after.noise_rms, before.noise_rms);
  for (std::size_t c = 0; c < 8; ++c) {
    EXPECT_EQ(after.channels[c].name, EIGHT[c]);
    EXPECT_NEAR(after.channels[c].force_per_unit, before.channels[c].force_per_unit, 1e-9);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(after.channels[c].position[axis], before.channels[c].position[axis], 1e-12);
      EXPECT_NEAR(after.channels[c].direction[axis], before.channels[c].direction[axis], 1e-12);
    }
  }
}

// The pipeline takes the eight channels, and refuses a block without one of them.
TEST(ChannelForces, ThePipelineTakesTheChannels) {
  const MachineModel model = modelOf(KISTLER);
  std::vector<ForceBlock> measured;
  CompensationPipeline::Outputs outputs;
  outputs.force.measured = [&](const ForceBlock& block) { measured.push_back(block); };
  CompensationPipeline pipeline({}, {}, model.force_sensor, 0.0, outputs);
  ASSERT_TRUE(pipeline.channels());
  SampleBlock block = blockOf(EIGHT, "pC", charges({{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {10, 11, 12}}}));
  pipeline.push(block);
  pipeline.push(SpindleAngle{block.stamp + 1.0, 0.0, 0.0});
  pipeline.flush();
  ASSERT_EQ(measured.size(), 1u);
  EXPECT_NEAR(measured[0].force[0][0], 22.0, 1e-9);
  EXPECT_NEAR(measured[0].force[1][0], 26.0, 1e-9);
  EXPECT_NEAR(measured[0].force[2][0], 30.0, 1e-9);
  block.samples[4] = NOT_A_NUMBER;
  EXPECT_TRUE(std::isnan(pipeline.channels()->forces(block).at(0, 0)));
  block.channels[7] = "fz5";
  EXPECT_THAT([&] { pipeline.push(block); }, ThrowsMessage<Error>(HasSubstr("channel 'fz4' is missing")));
  block.channels[7] = "fz4";
  block.units[7] = "V";
  EXPECT_THAT([&] { pipeline.push(block); },
              ThrowsMessage<Error>(HasSubstr("channel fz4: unit 'V', expected 'pC'")));
}

}  // namespace
}  // namespace smartmill::kalman
