// Files for other programs, read back by libraries that share no code with the writers (scipy, h5py, csv).

#include "smartmill_recording/export/exported_stream.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/io/uff.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_recording/recording_writer.h"

namespace smartmill::recording {
namespace {

using testing::HasSubstr;

constexpr double START = 1763700000.0;  // [s]
constexpr double RATE = 1000.0;         // [Hz]
constexpr std::size_t BLOCK = 10;       // samples
constexpr std::uint64_t NS = 1000000000;

struct Column {
  std::string unit;
  std::size_t count = 0;
  double first = 0.0, last = 0.0, sum = 0.0;
};
using Columns = std::map<std::string, Column>;  // by "stream name"

class Export : public testing::Test {
 protected:
  /// Five blocks of forces, of which the fourth was lost, and angles between them.
  std::string session() {
    const std::string path = folder_.file("session.bag");
    const auto writer = createRecording(path, RecordingCompression::none);
    for (std::uint64_t k = 0; k < 5; ++k) {
      const double stamp = START + static_cast<double>(k * BLOCK) / RATE;
      const std::uint64_t time = static_cast<std::uint64_t>(START) * NS + k * BLOCK * NS / 1000;
      SampleBlock block;
      block.stamp = stamp;
      block.sample_rate = RATE;
      block.first_index = k * BLOCK;
      block.channels = {"fx", "gap"};
      block.units = {"N", "V"};
      for (std::size_t i = 0; i < BLOCK; ++i) {
        block.samples.push_back(static_cast<double>(k * BLOCK + i));
        block.samples.push_back(0.5);
      }
      if (k != 3) writer->write("daq/forces", time, block);
      SpindleAngle angle;
      angle.stamp = stamp;
      angle.angle = 0.25 * static_cast<double>(k);
      angle.speed = 300.0;
      writer->write("spindle/angle", time, angle);
    }
    writer->close();
    return path;
  }

  Columns readBack(const std::string& file) {
    const std::string out = folder_.file("columns.txt");
    const int code =
        std::system(("/usr/bin/python3 test/export/check_export.py " + file + " > " + out + " 2>&1").c_str());
    EXPECT_EQ(code, 0) << readText(out);
    Columns columns;
    std::istringstream lines(readText(out));
    std::string stream, name;
    Column column;
    while (lines >> stream >> name >> column.unit >> column.count >> column.first >> column.last >>
           column.sum)
      columns[stream + " " + name] = column;
    return columns;
  }

  static void expectSession(const Columns& columns, const std::string& forces, const std::string& angles) {
    ASSERT_EQ(columns.size(), 6u);
    const Column &fx = columns.at(forces + " fx"), &time = columns.at(forces + " time");
    EXPECT_EQ(fx.unit, "N");
    EXPECT_EQ(fx.count, 40u);
    EXPECT_EQ(fx.first, 0.0);
    EXPECT_EQ(fx.last, 49.0);
    EXPECT_EQ(fx.sum, 49.0 * 50.0 / 2.0 - (30.0 + 39.0) * 10.0 / 2.0);  // without the lost block
    EXPECT_EQ(time.unit, "s");
    EXPECT_NEAR(time.last, 0.049, 1e-6);  // stamps since 1970 resolve 0.24 us
    EXPECT_EQ(columns.at(forces + " gap").unit, "V");
    EXPECT_EQ(columns.at(angles + " speed").unit, "rad/s");
    EXPECT_EQ(columns.at(angles + " angle").sum, 2.5);
  }

  TemporaryFolder folder_;
};

TEST_F(Export, MatlabFile) {
  const std::string file = folder_.file("session.mat");
  writeMatFile(streamsOfRecording(session(), {}), file);
  expectSession(readBack(file), "daq_forces", "spindle_angle");
}

TEST_F(Export, Hdf5File) {
  const std::string file = folder_.file("session.h5");
  writeHdf5File(streamsOfRecording(session(), {}), file);
  expectSession(readBack(file), "daq/forces", "spindle/angle");
}

TEST_F(Export, FolderOfCsvFiles) {
  const std::string folder = folder_.file("tables");
  writeCsvFolder(streamsOfRecording(session(), {}), folder);
  expectSession(readBack(folder), "daq_forces", "spindle_angle");
}

TEST_F(Export, UniversalFileWithTheLostBlockAsAJump) {
  const std::string file = folder_.file("session.uff");
  ExportSelection selection;
  selection.names = {"daq/forces"};
  writeUffFile(streamsOfRecording(session(), selection), file);
  const std::vector<UffFunction> functions = readUff(file);
  ASSERT_EQ(functions.size(), 2u);
  const UffFunction& fx = functions[0];
  EXPECT_EQ(fx.numerator, uff::REACTION_FORCE);
  EXPECT_EQ(fx.response_direction, 1);
  ASSERT_EQ(fx.value.size(), 40u);
  EXPECT_NEAR(fx.abscissa[29], 0.029, 1e-6);
  EXPECT_NEAR(fx.abscissa[30], 0.040, 1e-6);
}

TEST_F(Export, PartOfTheTime) {
  ExportSelection selection;
  selection.names = {"daq/forces"};
  selection.from = 0.0095;
  selection.to = 0.0255;
  const auto streams = streamsOfRecording(session(), selection);
  ASSERT_EQ(streams.size(), 1u);
  EXPECT_EQ(streams[0].size(), 16u);
  EXPECT_EQ(streams[0].columns[1].values.front(), 10.0);
}

TEST_F(Export, WhatIsMissingIsNamed) {
  ExportSelection selection;
  selection.names = {"daq/force"};
  const std::string file = session();
  try {
    streamsOfRecording(file, selection);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("topic 'daq/force': expected one of daq/forces, spindle/angle"));
  }
  selection.names.clear();
  selection.from = 10.0;
  EXPECT_THROW(streamsOfRecording(file, selection), Error);
}

}  // namespace
}  // namespace smartmill::recording
