#include "smartmill_daq/instrument/instrument.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_daq/drivers/driver.h"

namespace smartmill::daq {
namespace {

using ::testing::HasSubstr;

const char* const GOOD = R"(format: smartmill-instrument/1
name: front end
driver: tcp
options: {host: 127.0.0.1, port: 5045}
sample_rate: 51200.0
streams:
  - topic: daq/hammer
    channels:
      - {input: 2, name: hammer, unit: N, sensitivity: 0.00225, sensitivity_std: 2.0e-5, sensitivity_date: 2026-09-14, range: 10.0, coupling: iepe}
)";

std::string place() {
  static const TemporaryFolder folder;
  return folder.file("instrument.yaml");
}

/// What is reported of the file with a piece replaced.
std::string problem(const std::string& piece, const std::string& by) {
  std::string text = GOOD;
  const std::size_t at = text.find(piece);
  EXPECT_NE(at, std::string::npos) << piece;
  text.replace(at, piece.size(), by);
  const std::string file = place();
  writeText(file, text);
  std::optional<StrictYaml> options;
  try {
    makeDriver(file, readInstrument(file, &options), options);
  } catch (const Error& error) {
    const std::string what = error.what();
    EXPECT_EQ(what.rfind(file + ": ", 0), 0u) << what;
    EXPECT_EQ(what.find('\n'), std::string::npos);
    return what.substr(file.size() + 2);
  }
  return "";
}

TEST(Instrument, readsWhatTheFileSays) {
  EXPECT_EQ(problem("name: front end", "name: front end"), "");
  const std::string file = place();
  std::optional<StrictYaml> options;
  const Instrument instrument = readInstrument(file, &options);
  EXPECT_EQ(instrument.sample_rate, 51200.0);
  ASSERT_EQ(instrument.channels().size(), 1u);
  const Channel channel = instrument.channels()[0];
  EXPECT_EQ(channel.input, "2");
  EXPECT_EQ(channel.coupling, Coupling::iepe);
  EXPECT_EQ(channel.sensitivity, 0.00225);
  EXPECT_EQ(*channel.sensitivity_std, 2e-5);
  EXPECT_EQ(*channel.sensitivity_date, "2026-09-14");
  EXPECT_EQ(channel.stuck, 0.1);
}

TEST(Instrument, theShippedFilesAreRead) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(INSTRUMENTS)) {
    std::optional<StrictYaml> options;
    EXPECT_NO_THROW(readInstrument(entry.path(), &options)) << entry.path();
    ++count;
  }
  EXPECT_EQ(count, 3);
}

TEST(Instrument, aWrongFileIsRefusedInOneLine) {
  EXPECT_THAT(problem("driver: tcp", "driver: teleport"), HasSubstr("driver: 'teleport' is not one of "));
  EXPECT_THAT(problem("port: 5045", "prot: 5045"), HasSubstr("options.port: is missing"));
  EXPECT_THAT(problem("port: 5045", "port: 5045, baud: 9600"), HasSubstr("options.baud"));
  EXPECT_THAT(problem("options: {host: 127.0.0.1, port: 5045}", "block: 0.005"),
              HasSubstr("options: missing"));
  EXPECT_THAT(problem("sample_rate: 51200.0", "sample_rate: 0.0"), HasSubstr("sample_rate: 0"));
  EXPECT_THAT(problem("sample_rate: 51200.0", "sample_rate: 51200.0\nblock: 0.5"), HasSubstr("block: 0.5"));
  EXPECT_THAT(problem("unit: N", "unit: lbf"), HasSubstr("unit: 'lbf' is not one of N | N m"));
  EXPECT_THAT(problem("sensitivity: 0.00225", "sensitivity: 0.0"),
              HasSubstr("sensitivity: 0, expected volts per N"));
  EXPECT_THAT(problem("2026-09-14", "14.9.2026"),
              HasSubstr("sensitivity_date: '14.9.2026', expected YYYY-MM-DD"));
  EXPECT_THAT(problem("range: 10.0", "range: -1.0"), HasSubstr("range: -1"));
  EXPECT_THAT(problem("name: hammer", "name: force"), HasSubstr("daq/hammer needs a channel hammer in N"));
  EXPECT_THAT(problem("topic: daq/hammer", "topic: hammer"), HasSubstr("topic: 'hammer', expected daq/..."));
  EXPECT_THAT(problem("input: 2", "input: 65"), HasSubstr("input: '65', expected a number from 1 to 64"));
  EXPECT_THAT(problem("coupling: iepe", "coupling: ICP"),
              HasSubstr("coupling: 'ICP' is not one of dc | ac | iepe"));
}

}  // namespace
}  // namespace smartmill::daq
