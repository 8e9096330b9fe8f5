#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {

/// A fault that an edit of a good file makes, and what its reader says of it after "FILE: ".
struct Refusal {
  const char *from, *to, *message;
};

/// A text with the first `from` in it replaced.
inline std::string edited(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// Expects that read(file) refuses every edit of a good text with its one line.
template <class Read>
void expectRefusals(const std::string& good, const std::vector<Refusal>& refusals, const Read& read) {
  const TemporaryFolder folder;
  for (const Refusal& r : refusals) {
    const std::string file = folder.write("bad.yaml", edited(good, r.from, r.to));
    EXPECT_EQ(errorOf([&] { read(file); }), file + ": " + r.message);
  }
}

}  // namespace smartmill
