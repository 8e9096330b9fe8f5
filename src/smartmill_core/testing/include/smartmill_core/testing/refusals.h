#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {

/// A faulty edit of a valid file, and the reader's message after "FILE: ".
struct Refusal {
  const char *from, *to, *message;
};

/// A text with the first `from` replaced.
inline std::string edited(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// Expects that read(file) rejects every edit of a valid text with its message.
template <class Read>
void expectRefusals(const std::string& good, const std::vector<Refusal>& refusals, const Read& read) {
  const TemporaryFolder folder;
  for (const Refusal& r : refusals) {
    const std::string file = folder.write("bad.yaml", edited(good, r.from, r.to));
    EXPECT_EQ(errorOf([&] { read(file); }), file + ": " + r.message);
  }
}

}  // namespace smartmill
