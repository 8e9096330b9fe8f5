// Replays the fuzzing corpora, which include every input that once broke a reader.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "fuzz/targets.h"

namespace smartmill::fuzz {
namespace {

TEST(Fuzz, everyInputIsReadOrRefusedWithAnError) {
  for (const auto& [name, target] : targets()) {
    const std::filesystem::path folder = std::filesystem::path(CORPUS) / name;
    ASSERT_TRUE(std::filesystem::is_directory(folder)) << folder;
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      std::ifstream in(entry.path(), std::ios::binary);
      const std::vector<char> bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
      EXPECT_NO_THROW(target(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()))
          << entry.path();
      ++count;
    }
    EXPECT_GT(count, 0) << name;
  }
}

}  // namespace
}  // namespace smartmill::fuzz
