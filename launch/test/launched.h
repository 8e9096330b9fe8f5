#pragma once

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/testing/free_port.h"

/// Helpers of tests that start their own roslaunch.
namespace smartmill::testing {

inline std::string freePort() {
  return std::to_string(smartmill::freePort());
}

inline std::string contentOf(const std::string& file) {
  std::ifstream in(file);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

/// Runs a command with its output in a file. @return its exit code
inline int run(const std::string& command, const std::string& log) {
  return std::system(("timeout --signal=INT 400 " + command + " >'" + log + "' 2>&1").c_str());
}

}  // namespace smartmill::testing
