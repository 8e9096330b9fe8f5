#include "smartmill_recording/import/channel_file.h"

#include <cmath>
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hdf5_writer.h"
#include "mat_writer.h"
#include "smartmill_core/io/sound_file.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/io/uff.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill::recording {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double RATE = 1000.0;  // [Hz]

std::vector<double> wave(std::size_t count, double amplitude) {
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i)
    values.push_back(amplitude * std::sin(0.1 * static_cast<double>(i)));
  return values;
}

std::vector<double> times(std::size_t count) {
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(static_cast<double>(i) / RATE);
  return values;
}

const FileChannel& channel(const ChannelFile& file, const std::string& name) {
  const FileChannel* found = file.find(name);
  if (!found) throw Error(name + " not found");
  return *found;
}

struct MatCase {
  mat_ft version;
  matio_compression packing;
  const char* kind;
};

class MatFile : public testing::TestWithParam<MatCase> {};

TEST_P(MatFile, holdsVectorsMatricesStructsAndNumbers) {
  const TemporaryFolder folder;
  const std::string file = folder.file("cut.mat");
  {
    MatWriter mat(file, GetParam().version, GetParam().packing);
    mat.add(MatWriter::numbers("t_s", times(200)));
    mat.add(MatWriter::numbers("Fs", {RATE}));
    std::vector<double> both = wave(200, 3.0);
    const std::vector<double> second = wave(200, 5.0);
    both.insert(both.end(), second.begin(), second.end());
    mat.add(MatWriter::numbers("data", both, 2));
    mat.add(MatWriter::structOf("s", {{"fx", MatWriter::numbers("fx", wave(200, 7.0))},
                                      {"fx_unit", MatWriter::word("fx_unit", "kN")}}));
  }
  const ChannelFile read = readChannelFile(file);
  EXPECT_EQ(read.kind, GetParam().kind);
  EXPECT_EQ(read.sample_rate, RATE);
  EXPECT_EQ(channel(read, "t").unit, "s");
  EXPECT_EQ(channel(read, "t").values, times(200));
  EXPECT_EQ(channel(read, "data:1").values, wave(200, 3.0));
  EXPECT_EQ(channel(read, "data:2").values, wave(200, 5.0));
  EXPECT_EQ(channel(read, "s.fx").values, wave(200, 7.0));
  EXPECT_EQ(channel(read, "s.fx").unit, "kN");
}

INSTANTIATE_TEST_SUITE_P(Versions, MatFile,
                         testing::Values(MatCase{MAT_FT_MAT5, MAT_COMPRESSION_NONE, "MATLAB 5"},
                                         MatCase{MAT_FT_MAT5, MAT_COMPRESSION_ZLIB, "MATLAB 5"},
                                         MatCase{MAT_FT_MAT73, MAT_COMPRESSION_NONE, "MATLAB 7.3"}));

TEST(MatFileTest, cellsAreNotedAndNotRead) {
  const TemporaryFolder folder;
  const std::string file = folder.file("cells.mat");
  {
    MatWriter mat(file, MAT_FT_MAT5);
    std::size_t dims[2] = {1, 1};
    matvar_t* cell = Mat_VarCreate("names", MAT_C_CELL, MAT_T_CELL, 2, dims, nullptr, 0);
    Mat_VarSetCell(cell, 0, MatWriter::word("", "fx"));
    mat.add(cell);
    mat.add(MatWriter::numbers("fx_N", wave(20, 1.0)));
  }
  const ChannelFile read = readChannelFile(file);
  EXPECT_THAT(read.notes, ElementsAre("names: a cell array, not read"));
  EXPECT_EQ(channel(read, "fx").unit, "N");
}

TEST(MatFileTest, hugeClaimIsRefused) {
  const TemporaryFolder folder;
  const std::string file = folder.file("claim.mat");
  {
    MatWriter mat(file, MAT_FT_MAT5);
    mat.add(MatWriter::numbers("fx", wave(20, 1.0)));
  }
  std::string bytes = readText(file);
  // Header 128, tag 8, array flags 16, tag of the dimensions 8: the number of rows [MAT-File Format, fig.
  // 1-4].
  const std::size_t rows = 128 + 8 + 16 + 8;
  ASSERT_EQ(bytes[rows], 20);
  bytes.replace(rows, 4, std::string("\xFF\xFF\xFF\x7F", 4));  // 2147483647
  EXPECT_EQ(errorOf([&] { readChannelFile(folder.write("claim.mat", bytes)); }),
            file + ": fx: 2147483647 values, at most 200000000 are read");
  bytes.replace(rows, 4, std::string("\x00\xE1\xF5\x05", 4));  // 1e8
  EXPECT_THAT(errorOf([&] { readChannelFile(folder.write("claim.mat", bytes)); }),
              HasSubstr("100000000 values in a file of 3"));
}

/// Cut and damaged versions of a file are read or refused with one line that names the file.
void expectOneLine(const std::string& good, const std::string& name) {
  const TemporaryFolder folder;
  const std::string bytes = readText(good), file = folder.file(name);
  std::size_t cuts = 0, refused = 0;
  for (std::size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 97) {
    folder.write(name, bytes.substr(0, size));
    const std::string line = errorOf([&] { readChannelFile(file); });
    ++cuts;
    refused += line.empty() ? 0 : 1;
    if (line.empty()) continue;
    EXPECT_EQ(line.rfind(file + ": ", 0), 0u) << line;
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
  }
  EXPECT_GT(refused, cuts * 9 / 10) << name;
  unsigned state = 1;
  for (int round = 0; round < 150; ++round) {
    std::string damaged = bytes;
    for (int i = 0; i < 3; ++i) {
      state = state * 1664525u + 1013904223u;
      damaged[(state >> 8) % std::min<std::size_t>(damaged.size(), 4096)] = static_cast<char>(state >> 24);
    }
    folder.write(name, damaged);
    const std::string line = errorOf([&] { readChannelFile(file); });
    EXPECT_TRUE(line.empty() || line.rfind(file + ": ", 0) == 0) << line;
  }
}

TEST(DamagedFile, matOfEachVersionIsRefusedInOneLine) {
  for (const auto& [version, packing] :
       {std::pair{MAT_FT_MAT5, MAT_COMPRESSION_NONE}, std::pair{MAT_FT_MAT5, MAT_COMPRESSION_ZLIB},
        std::pair{MAT_FT_MAT73, MAT_COMPRESSION_NONE}}) {
    const TemporaryFolder folder;
    {
      MatWriter mat(folder.file("good.mat"), version, packing);
      mat.add(MatWriter::structOf("s", {{"fx", MatWriter::numbers("fx", wave(300, 7.0))},
                                        {"fx_unit", MatWriter::word("fx_unit", "kN")}}));
      mat.add(MatWriter::numbers("t", times(300)));
    }
    expectOneLine(folder.file("good.mat"), "bad.mat");
  }
}

TEST(DamagedFile, hdf5IsRefusedInOneLine) {
  const TemporaryFolder folder;
  {
    Hdf5Writer hdf5(folder.file("good.h5"));
    hdf5.dataset("fx", wave(300, 7.0), {300}, "N");
    hdf5.number("/", "sample_rate_hz", RATE);
  }
  expectOneLine(folder.file("good.h5"), "bad.h5");
}

TEST(DamagedFile, garbageOfAnyNameIsRefusedInOneLine) {
  const TemporaryFolder folder;
  const std::string garbage("\x01\x02\x00\xFFgarbage\x00\x10 and more", 22);
  for (const char* name : {"a.mat", "a.h5", "a.wav", "a.flac", "a.csv", "a.uff"}) {
    const std::string file = folder.write(name, garbage), line = errorOf([&] { readChannelFile(file); });
    EXPECT_EQ(line.rfind(file + ": ", 0), 0u) << line;
    EXPECT_EQ(errorOf([&] { readChannelFile(folder.write(name, "")); }), file + ": is empty");
  }
  EXPECT_THAT(errorOf([&] { readChannelFile(folder.write("head.mat", "MATLAB 5.0 MAT-file")); }),
              HasSubstr("head.mat: truncated: 19 bytes"));
  EXPECT_EQ(errorOf([&] { readChannelFile(folder.write("a.tdms", "TDSm")); }),
            folder.file("a.tdms") + ": TDMS files are not supported; export as CSV, MAT or HDF5");
}

TEST(Hdf5File, datasetsOfGroupsWithAttributes) {
  const TemporaryFolder folder;
  const std::string file = folder.file("cut.h5");
  {
    Hdf5Writer hdf5(file);
    hdf5.group("cut");
    hdf5.dataset("cut/fx", wave(50, 2.0), {50}, "kN");
    hdf5.dataset("cut/both", {1, 10, 2, 20, 3, 30}, {3, 2});
    hdf5.dataset("teeth", {4}, {1});
    hdf5.number("cut", "dt", 1.0 / RATE);
  }
  const ChannelFile read = readChannelFile(file);
  EXPECT_EQ(channel(read, "cut/fx").values, wave(50, 2.0));
  EXPECT_EQ(channel(read, "cut/fx").unit, "kN");
  EXPECT_THAT(channel(read, "cut/both:1").values, ElementsAre(1, 2, 3));
  EXPECT_THAT(channel(read, "cut/both:2").values, ElementsAre(10, 20, 30));
  EXPECT_EQ(read.numbers.at("teeth"), 4.0);
  EXPECT_NEAR(read.sample_rate.value(), RATE, 1e-9);
}

TEST(Hdf5File, claimsAreRefused) {
  const TemporaryFolder folder;
  const std::string file = folder.file("claim.h5");
  { Hdf5Writer(file).claim("fx", 1ull << 31); }
  EXPECT_EQ(errorOf([&] { readChannelFile(file); }),
            file + ": fx: 2147483648 values, at most 200000000 are read");
  { Hdf5Writer(file).claim("fx", 100000000); }
  EXPECT_EQ(errorOf([&] { readChannelFile(file); }), file + ": fx: its values were never written");
}

/// Runs a Python program that writes a file. @return false where a module is missing
bool written(const TemporaryFolder& folder, const std::string& program, const std::string& file) {
  return std::system(("/usr/bin/python3 " + folder.write("write.py", program) + " " + file + " 2>/dev/null")
                         .c_str()) == 0;
}

void expectSine(const FileChannel& channel, double tolerance) {
  ASSERT_EQ(channel.values.size(), 100u);
  for (std::size_t i = 0; i < channel.values.size(); ++i)
    EXPECT_NEAR(channel.values[i], std::sin(static_cast<double>(i) / RATE * 50.0), tolerance);
}

// scipy shares no code with libmatio.
TEST(OtherWriters, scipy) {
  const TemporaryFolder folder;
  const std::string file = folder.file("a.mat");
  if (!written(
          folder,
          "import sys, numpy, scipy.io\n"
          "t = numpy.arange(100) / 1000.0\n"
          "scipy.io.savemat(sys.argv[1], {'s': {'t_s': t, 'fx': numpy.sin(t * 50), 'fx_unit': 'kN'}, 'Fs': "
          "1000.0,\n"
          "                               'raw': numpy.arange(100, dtype='int16'), 'c': [['a', 'bc']]},\n"
          "                 do_compression=True)\n",
          file))
    GTEST_SKIP() << "scipy is absent";
  const ChannelFile read = readChannelFile(file);
  EXPECT_EQ(read.sample_rate, RATE);
  EXPECT_EQ(channel(read, "s.t").unit, "s");
  EXPECT_EQ(channel(read, "s.fx").unit, "kN");
  EXPECT_EQ(channel(read, "raw").values[99], 99.0);
  expectSine(channel(read, "s.fx"), 1e-15);
}

TEST(OtherWriters, h5py) {
  const TemporaryFolder folder;
  const std::string file = folder.file("a.h5");
  if (!written(folder,
               "import sys, numpy, h5py\n"
               "fx = numpy.sin(numpy.arange(100) / 1000.0 * 50)\n"
               "with h5py.File(sys.argv[1], 'w') as f:\n"
               "    d = f.create_dataset('run/fx', data=fx.astype('f4'), compression='gzip')\n"
               "    d.attrs['units'] = 'N'\n"
               "    f.attrs['sample_rate'] = 1000\n",
               file))
    GTEST_SKIP() << "h5py is absent";
  const ChannelFile read = readChannelFile(file);
  EXPECT_EQ(channel(read, "run/fx").unit, "N");
  EXPECT_EQ(read.sample_rate, RATE);
  expectSine(channel(read, "run/fx"), 1e-7);  // single precision
}

struct TextCase {
  const char* text;
  const char *names, *units;  // of the first and the second channel
  double second_of_last_row;
};

TEST(TextTable, styles) {
  const TemporaryFolder folder;
  const TextCase cases[] = {
      {"Time (s), Fx (N)\n0,1.5\n0.1,2.5\n0.2,3.5\n", "Time,Fx", "s,N", 3.5},
      {"Time [s];Fx [kN]\n0;1,5\n0,1;2,5\n0,2;-3,5e-1\n", "Time,Fx", "s,kN", -0.35},
      {"Measured on Monday\nSampling rate [Hz]: 10\n\nTime\tFx\ns\tN\n0\t1\n0.1\t2\n0.2\t3\n", "Time,Fx",
       "s,N", 3},
      {"Time;Fx;\r\n[ms];[N];\r\n0;1;\r\n100;2;\r\n200;3;\r\n", "Time,Fx", "ms,N", 3},
      {"\"Time, absolute [s]\",\"Fx {N}\"\n0,1\n1,2\n2,4\n", "Time, absolute,Fx", "s,N", 4},
      {"0.0e+000  1.0\n1.0e-001  2.0\n2.0e-001 -3.5e+000\n", "1,2", ",", -3.5},
      {"t_s,Acc / m/s\xC2\xB2\n0,1\n1,2\n2,9\n", "t,Acc", "s,m/s\xC2\xB2", 9}};
  for (const TextCase& c : cases) {
    const ChannelFile read = readChannelFile(folder.write("a.csv", c.text));
    ASSERT_EQ(read.channels.size(), 2u) << c.text;
    EXPECT_EQ(read.channels[0].name + "," + read.channels[1].name, c.names) << c.text;
    EXPECT_EQ(read.channels[0].unit + "," + read.channels[1].unit, c.units) << c.text;
    ASSERT_EQ(read.channels[1].values.size(), 3u) << c.text;
    EXPECT_EQ(read.channels[1].values[2], c.second_of_last_row) << c.text;
  }
}

// As many columns as a spectrum analyser exports: their names are compared in one pass.
TEST(TextTable, manyColumns) {
  const TemporaryFolder folder;
  constexpr int COLUMNS = 200000;
  std::string names, row;
  for (int c = 0; c < COLUMNS; ++c) {
    names += (c ? ",c" : "c") + std::to_string(c);
    row += c ? ",1" : "1";
  }
  const ChannelFile read =
      readChannelFile(folder.write("a.csv", names + "\n" + row + "\n" + row + "\n" + row + "\n"));
  EXPECT_EQ(read.channels.size(), COLUMNS);
  EXPECT_EQ(errorOf([&] { readChannelFile(folder.write("a.csv", "a,b,a\n1,2,3\n1,2,3\n1,2,3\n")); }),
            folder.file("a.csv") + ": two columns are named 'a'");
}

TEST(TextTable, rateOfThePreamble) {
  const TemporaryFolder folder;
  const ChannelFile read = readChannelFile(
      folder.write("a.csv", "DynoWare,2.5\nSampling rate [Hz]:,10000\nFx,Fy\nN,N\n1,2\n3,4\n5,6\n"));
  EXPECT_EQ(read.sample_rate, 10000.0);
}

TEST(TextTable, faultsNameTheLine) {
  const TemporaryFolder folder;
  const std::string head = "t [s],fx [N]\n0,1\n1,2\n2,3\n", file = folder.file("a.csv");
  const auto fault = [&](const std::string& text) {
    return errorOf([&] { readChannelFile(folder.write("a.csv", text)); });
  };
  EXPECT_EQ(fault(head + "3,abc\n"), file + ": line 5: column fx [N]: 'abc' is not a number");
  EXPECT_EQ(fault(head + "3,nan\n"), file + ": line 5: column fx [N]: 'nan' is not a finite number");
  EXPECT_EQ(fault(head + "3\n"), file + ": line 5: 1 values, 2 expected");
  EXPECT_EQ(fault(head + "\n3,4\n"), file + ": line 5: is empty");
  EXPECT_EQ(
      fault("words\nonly\n"),
      file + ": no rows of numbers found; expected columns separated by comma, semicolon, tab or blanks");
}

TEST(SoundChannels, shareOfFullScale) {
  const TemporaryFolder folder;
  SoundFile sound;
  sound.sample_rate = 8000.0;
  sound.channels = {{0.0, 0.5, -0.5}, {0.25, 0.0, 0.125}};
  writeWav(sound, folder.file("a.wav"));
  const ChannelFile read = readChannelFile(folder.file("a.wav"));
  EXPECT_EQ(read.sample_rate, 8000.0);
  EXPECT_EQ(channel(read, "2").unit, "full_scale");
  EXPECT_NEAR(channel(read, "2").values[2], 0.125, 1e-6);  // 24 bits
}

TEST(UffChannels, namedByKindOfData) {
  const TemporaryFolder folder;
  UffFunction force, motion;
  force.type = motion.type = uff::TIME_RESPONSE;
  force.numerator = uff::EXCITATION_FORCE;
  motion.numerator = uff::ACCELERATION;
  force.unit = "N";
  motion.unit = "g";
  for (int i = 0; i < 4; ++i) {
    force.abscissa.push_back(i * 0.5);
    force.value.emplace_back(i, 0.0);
    motion.value.emplace_back(-i, 0.0);
  }
  motion.abscissa = force.abscissa;
  writeUff({force, motion}, folder.file("a.uff"), false);
  const ChannelFile read = readChannelFile(folder.file("a.uff"));
  EXPECT_EQ(channel(read, "hammer").unit, "N");
  EXPECT_EQ(channel(read, "acceleration").unit, "g");
  EXPECT_THAT(channel(read, "acceleration").values, ElementsAre(0, -1, -2, -3));
  EXPECT_THAT(channel(read, "time").values, ElementsAre(0, 0.5, 1, 1.5));
}

}  // namespace
}  // namespace smartmill::recording
