#include "smartmill_core/io/uff.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

UffFunction receptance(bool even) {
  UffFunction f;
  f.type = uff::FREQUENCY_RESPONSE;
  f.name = "point 1";
  f.response_node = 7;
  f.response_direction = 3;
  f.reference_node = 1;
  f.reference_direction = -3;
  f.numerator = uff::DISPLACEMENT;
  f.denominator = uff::EXCITATION_FORCE;
  f.unit = "m";
  for (int i = 0; i < 9; ++i) {
    f.abscissa.push_back(even ? 100.0 + 0.5 * i : 100.0 + 0.3 * i * i);
    f.value.emplace_back(1.25e-8 * (i - 4), -3e-9 * i);
  }
  return f;
}

TEST(Uff, ReadsBackWhatWasWritten) {
  const TemporaryFolder folder;
  const std::string file = folder.file("frf.uff");
  for (const bool binary : {false, true}) {
    for (const bool even : {false, true}) {
      const UffFunction expected = receptance(even);
      writeUff({expected, expected}, file, binary);
      EXPECT_TRUE(isUff(file));
      const std::vector<UffFunction> found = readUff(file);
      ASSERT_EQ(found.size(), 2u);
      EXPECT_EQ(found[1].response_node, 7);
      EXPECT_EQ(found[1].response_direction, 3);
      EXPECT_EQ(found[1].reference_direction, -3);
      EXPECT_EQ(found[1].numerator, uff::DISPLACEMENT);
      EXPECT_EQ(found[1].unit, "m");
      ASSERT_EQ(found[1].value.size(), expected.value.size());
      for (std::size_t i = 0; i < expected.value.size(); ++i) {
        EXPECT_NEAR(found[1].abscissa[i], expected.abscissa[i], 1e-5);
        EXPECT_NEAR(std::abs(found[1].value[i] - expected.value[i]), 0.0, 1e-18);
      }
    }
  }
}

// An independent reader, written from the definition of the dataset (read_uff.py).
TEST(Uff, AnIndependentReaderReadsWhatWasWritten) {
  const TemporaryFolder folder;
  for (const bool binary : {false, true}) {
    for (const bool even : {false, true}) {
      const UffFunction expected = receptance(even);
      const std::string file = folder.file("frf.uff"), out = folder.file("frf.json");
      writeUff({expected, expected}, file, binary);
      ASSERT_EQ(std::system(("/usr/bin/python3 test/io/read_uff.py " + file + " >" + out).c_str()), 0);
      std::string line =
          "{\"type\": 4, \"name\": \"point 1\", \"response\": [7, 3], \"reference\": [1, -3], \"numerator\": "
          "8, ";
      const auto list = [&line](const char* name, const auto& numberOf) {
        line += std::string("\"") + name + "\": [";
        for (std::size_t i = 0; i < 9; ++i)
          line += (i ? ", " : "") + std::to_string(std::lround(numberOf(i)));
        line += "]";
      };
      list("abscissa_um", [&](std::size_t i) { return 1e6 * expected.abscissa[i]; });
      line += ", ";
      list("real_pm", [&](std::size_t i) { return 1e12 * expected.value[i].real(); });
      line += ", ";
      list("imag_pm", [&](std::size_t i) { return 1e12 * expected.value[i].imag(); });
      line += "}";
      EXPECT_EQ(readText(out), "[" + line + ", " + line + "]\n");
    }
  }
}

// As in the description of dataset 58: single precision in adjacent fields of 13 columns, other datasets in
// between, D exponents.
TEST(Uff, ReadsSinglePrecisionText) {
  const TemporaryFolder folder;
  const std::string file = folder.file("old.unv");
  std::ofstream(file)
      << "    -1\n   151\nmodel\nnone\n    -1\n    -1\n    58\nhammer\nNONE\nNONE\nNONE\nNONE\n"
         "    1         0    0         0 NONE               1   3 NONE               1   3\n"
         "         2         5         1  0.00000E+00  1.00000D-03  0.00000E+00\n"
         "        17    0    0    0 Time                 s\n"
         "        13    0    0    0 Force                N\n"
         "         0    0    0    0 NONE                 NONE\n"
         "         0    0    0    0 NONE                 NONE\n"
         " -1.00000E+00-2.00000E+00-3.00000E+00-4.00000E+00-5.00000E+00\n    -1\n";
  const std::vector<UffFunction> found = readUff(file);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].type, uff::TIME_RESPONSE);
  EXPECT_EQ(found[0].numerator, uff::EXCITATION_FORCE);
  ASSERT_EQ(found[0].value.size(), 5u);
  EXPECT_DOUBLE_EQ(found[0].value[4].real(), -5.0);
  EXPECT_DOUBLE_EQ(found[0].abscissa[4], 4e-3);
}

TEST(Uff, ErrorsNameDatasetAndFault) {
  const TemporaryFolder folder;
  const std::string file = folder.file("short.uff");
  writeUff({receptance(true)}, file, true);
  std::string text;
  {
    std::ifstream in(file, std::ios::binary);
    text.assign(std::istreambuf_iterator<char>(in), {});
  }
  std::ofstream(file, std::ios::binary) << text.substr(0, text.size() - 60);
  try {
    readUff(file);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("short.uff: dataset 1: ends too early"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace smartmill
