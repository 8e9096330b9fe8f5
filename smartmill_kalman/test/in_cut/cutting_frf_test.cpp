#include "smartmill_kalman/in_cut/cutting_frf.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/in_cut/cut_segments.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0;

ModalModel structure() {
  ModalModel tool;
  tool.modes = {{1150.0, 0.03, 1.0 / 22e6}};
  return tool;
}

/// A force of all orders of the spindle through a structure, in its steady state by the closed form, with
/// noise on both channels. @param ramp [1/s] of the speed
CutSegment periodic(double rpm, std::mt19937& random, double ramp = 0.0, double force_noise = 1.0,
                    double response_noise = 5e-8) {
  CutSegment cut;
  cut.name = "periodic";
  cut.sample_rate = RATE;
  cut.speed = units::radPerSecFromRpm(rpm);
  std::normal_distribution<double> normal;
  std::vector<double> phase(64);
  for (double& p : phase) p = std::uniform_real_distribution<double>(0.0, units::TWO_PI)(random);
  const ModalModel tool = structure();
  for (int i = 0; i < 10240; ++i) {
    const double t = i / RATE, angle = cut.speed * (t + 0.5 * ramp * t * t);
    const double speed = cut.speed * (1.0 + ramp * t);
    double force = 300.0, response = force * tool.staticGain();
    for (std::size_t k = 1; k < phase.size(); ++k) {
      const double f = static_cast<double>(k) * speed / units::TWO_PI;
      if (f > 4000.0) break;
      const std::complex<double> wave =
          std::polar(k % 4 == 0 ? 30.0 : 6.0, static_cast<double>(k) * angle + phase[k]);
      force += wave.real();
      response += (tool.response(f) * wave).real();
    }
    cut.angle.push_back(std::fmod(angle, units::TWO_PI));
    cut.force.push_back(force + force_noise * normal(random));
    cut.response.push_back(response + response_noise * normal(random));
  }
  return cut;
}

// At every line, over force and response with noise: errors agree with the standard deviations.
TEST(CuttingLines, DeviationsCoverTheTruth) {
  std::mt19937 random(1);
  Coverage coverage;
  CuttingFrfOptions options;
  options.high = 3000.0;
  for (int run = 0; run < 12; ++run) {
    for (const FrfLine& line : frfLines(periodic(4200.0 + 300.0 * run, random), options)) {
      const std::complex<double> error = line.value - structure().response(line.frequency);
      coverage.add(std::sqrt(2.0) * error.real(), line.std_dev);
      coverage.add(std::sqrt(2.0) * error.imag(), line.std_dev);
    }
  }
  EXPECT_GT(coverage.size(), 500U);
  // Five deviations of a root mean square of 500 errors with the tails of 16 degrees of freedom.
  EXPECT_NEAR(coverage.rms(), 1.0, 0.17);
}

// A spindle that runs up by a tenth a second: every part has its own speed, one FRF comes out.
TEST(CuttingLines, ASweepIsAsGoodAsManyCuts) {
  std::mt19937 random(2);
  CuttingFrfOptions options;
  options.high = 3000.0;
  options.part = 0.13;
  std::vector<FrfLine> lines;
  for (const double rpm : {6000.0, 6240.0, 6490.0}) {
    const auto found = frfLines(periodic(rpm, random, 0.1), options);
    lines.insert(lines.end(), found.begin(), found.end());
  }
  const std::vector<SpeedFrf> frfs = cuttingFrfs(lines, "m/N", options);
  ASSERT_EQ(frfs.size(), 1U);
  ASSERT_TRUE(frfs[0].fit) << frfs[0].reason;
  ASSERT_EQ(frfs[0].fit->model.modes.size(), 1U);
  // The speed moves the lines by 80 Hz a second at the mode: its delay of 4 ms shifts it by 0.3 Hz.
  const Mode& mode = frfs[0].fit->model.modes[0];
  EXPECT_NEAR(mode.frequency, 1150.0, 2.0);
  EXPECT_NEAR(mode.damping_ratio, 0.03, 0.001);
}

TEST(CuttingFrf, AbstainsFromFewAndFromNoisyLines) {
  std::mt19937 random(3);
  CuttingFrfOptions options;
  options.low = 700.0;
  options.high = 1600.0;
  const auto few = cuttingFrfs(frfLines(periodic(12000.0, random), options), "m/N", options);
  ASSERT_EQ(few.size(), 1U);
  EXPECT_FALSE(few[0].fit);
  EXPECT_NE(few[0].reason.find("lines, expected at least 12"), std::string::npos) << few[0].reason;
  // A response that is noise: lines, but no mode.
  std::vector<FrfLine> lines;
  for (const double rpm : {5800.0, 6000.0, 6200.0}) {
    const auto found = frfLines(periodic(rpm, random, 0.0, 1.0, 1e-4), options);
    lines.insert(lines.end(), found.begin(), found.end());
  }
  const auto noisy = cuttingFrfs(lines, "m/N", options);
  ASSERT_EQ(noisy.size(), 1U);
  EXPECT_FALSE(noisy[0].fit);
  EXPECT_FALSE(noisy[0].reason.empty());
}

TEST(CuttingLines, RefusesWhatIsNoCut) {
  std::mt19937 random(4);
  CutSegment cut = periodic(6000.0, random);
  cut.response.pop_back();
  EXPECT_THROW(frfLines(cut, {}), Error);
  cut = periodic(6000.0, random);
  cut.force[7] = NAN;
  EXPECT_THROW(frfLines(cut, {}), Error);
  CuttingFrfOptions options;
  options.high = 100.0;
  EXPECT_THROW(frfLines(periodic(6000.0, random), options), Error);
}

// Cuts of another program's machine, its tool known: its cuts give that tool at each speed.
TEST(CuttingFrf, FindsTheToolOfAnIndependentCampaign) {
  SMARTMILL_SHARED_DATA(folder, "campaigns/vibrating_runout");
  const Campaign campaign = readCampaign(folder);
  const MachineModel model = readMachineModel(campaign.modelPath());
  for (std::size_t axis = 0; axis < 2; ++axis) {
    std::vector<FrfLine> lines;
    for (const CampaignTest& test : campaign.tests) {
      if (test.kind != TestKind::cut) continue;
      const CutSegment cut =
          toolSegment(readRecord(campaign, test, model), test, axis, model.force_sensor.axis[axis]);
      const auto found = frfLines(cut, {});
      lines.insert(lines.end(), found.begin(), found.end());
    }
    const Mode& truth = (axis == 0 ? model.tool_tip.x : model.tool_tip.y).modes.front();
    int fits = 0;
    for (const SpeedFrf& frf : cuttingFrfs(lines, "m/N", {})) {
      if (!frf.fit) continue;
      ++fits;
      ASSERT_EQ(frf.fit->model.modes.size(), 1U);
      const Mode& mode = frf.fit->model.modes.front();
      // That program's own integration is good to 0.04 N of 20 N a line.
      EXPECT_NEAR(mode.frequency, truth.frequency, 1.5);
      EXPECT_NEAR(mode.damping_ratio, truth.damping_ratio, 0.04 * truth.damping_ratio);
      EXPECT_NEAR(mode.gain, truth.gain, 0.01 * truth.gain);
    }
    EXPECT_EQ(fits, 3);  // 13,950 rpm has too few lines, 1200 and 3000 too few revolutions
  }
}

}  // namespace
}  // namespace smartmill::kalman
