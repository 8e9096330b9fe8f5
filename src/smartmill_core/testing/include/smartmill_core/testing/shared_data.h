#pragma once

#include <string>

#include <gtest/gtest.h>

namespace smartmill {

/// The folder of data next to the repository, not part of it: $SMARTMILL_SHARED, else ../shared.
std::string sharedFolder();

/// Path of a file or folder in it; empty when absent.
std::string sharedData(const std::string& name);

}  // namespace smartmill

/// In a test: declares the path of shared data, or skips the test when absent.
///     SMARTMILL_SHARED_DATA(folder, "measured/slot_6000");
#define SMARTMILL_SHARED_DATA(variable, name)                 \
  const std::string variable = ::smartmill::sharedData(name); \
  if ((variable).empty()) GTEST_SKIP() << ::smartmill::sharedFolder() << "/" << (name) << " is absent"
