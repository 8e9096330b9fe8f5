// The reference senders against the driver, through the acquisition.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_daq/acquisition/acquisition.h"

namespace smartmill::daq {
namespace {

constexpr double RATE = 51200.0, SECONDS = 0.5;

double wallTime() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// A process whose first line is "listening on PORT".
class Sender {
 public:
  explicit Sender(const std::string& command) : pipe_(::popen(command.c_str(), "r")) {
    if (!pipe_ || std::fscanf(pipe_, "listening on %d", &port_) != 1) port_ = 0;
  }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;
  ~Sender() {
    if (pipe_) ::pclose(pipe_);
  }
  int port() const { return port_; }

 private:
  std::FILE* pipe_;
  int port_ = 0;
};

void expectSines(const std::string& command) {
  const Sender sender(command);
  ASSERT_NE(sender.port(), 0) << command;
  const TemporaryFolder folder;
  const std::string file = folder.file("instrument.yaml");
  writeText(
      file,
      formatted(
          "format: smartmill-instrument/1\nname: sender\ndriver: tcp\noptions: {host: 127.0.0.1, port: %d}\n"
          "sample_rate: 51200.0\nstreams:\n  - topic: daq/dynamometer\n    channels:\n"
          "      - {input: 3, name: fx, unit: N, sensitivity: 0.01, range: 10.0}\n"
          "      - {input: 1, name: fy, unit: N, sensitivity: -0.02, range: 10.0}\n",
          sender.port()));
  std::optional<StrictYaml> options;
  const Instrument instrument = readInstrument(file, &options);
  std::vector<SampleBlock> blocks;
  std::vector<Fault> faults;
  Acquisition::Outputs outputs;
  outputs.block = [&](const Stream&, const SampleBlock& block) { blocks.push_back(block); };
  outputs.fault = [&](const Fault& fault) { faults.push_back(fault); };
  Acquisition acquisition(instrument, makeDriver(file, instrument, options), outputs, wallTime);
  while (faults.empty() || faults.back().kind != FaultKind::unplugged) ASSERT_TRUE(acquisition.step());
  EXPECT_THAT(faults.back().text, ::testing::HasSubstr("the device has closed the connection"));
  const SampleAccount account = acquisition.state().account;
  EXPECT_EQ(account.delivered, static_cast<std::uint64_t>(RATE * SECONDS));
  EXPECT_EQ(account.lost + account.estimated_lost + account.withheld, 0u);
  for (const SampleBlock& block : blocks) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double time = static_cast<double>(block.first_index + i) / RATE;
      ASSERT_NEAR(block.at(i, 0), std::sin(units::TWO_PI * 300.0 * time) / 0.01, 1e-4);
      ASSERT_NEAR(block.at(i, 1), std::sin(units::TWO_PI * 100.0 * time) / -0.02, 1e-4);
    }
  }
}

TEST(TcpDriver, receivesTheReferenceSenderInPython) {
  expectSines(formatted("/usr/bin/python3 %s/send_samples.py --port 0 --seconds %.1f", EXAMPLES, SECONDS));
}

TEST(TcpDriver, receivesTheReferenceSenderInC) {
  expectSines(formatted("%s 0 51200 6 %.1f 0", C_SENDER, SECONDS));
}

}  // namespace
}  // namespace smartmill::daq
