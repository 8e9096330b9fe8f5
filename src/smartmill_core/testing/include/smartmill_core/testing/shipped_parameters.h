#pragma once

#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/parameters/parameter_reader.h"

namespace smartmill {

/// Expects that the shipped file of a node equals the text of its parameter table and can be read back.
/// @param file relative to the folder of the package, in which tests run
/// @param program that prints it with --parameters
template <class Parameters>
void expectShipped(const std::string& file, const std::string& program) {
  std::ifstream stream(file);
  ASSERT_TRUE(stream) << file << " cannot be read";
  std::ostringstream text;
  text << stream.rdbuf();
  Parameters defaults;
  EXPECT_EQ(text.str(), tableOf(defaults).yaml()) << "rosrun " << program << " --parameters > " << file;
  Parameters read;
  ParameterReader reader = ParameterReader::fromFile(file);
  EXPECT_NO_THROW(reader.read(tableOf(read)));
  EXPECT_NO_THROW(reader.finish());
}

}  // namespace smartmill
