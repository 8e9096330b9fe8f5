#pragma once

#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>

#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {

/// What a command line did.
struct Outcome {
  int code = 0;
  std::string out, error;
  std::map<std::string, std::string> files;  ///< that it wrote, by path
};

/// Runs a line of bash in a folder of its own.
inline Outcome shell(const std::string& line) {
  const TemporaryFolder folder;
  const TemporaryFolder streams;
  const std::string script = streams.write("script", "cd '" + folder.file(".") + "'\n" + line + "\n");
  const int status = std::system(
      ("bash '" + script + "' >'" + streams.file("out") + "' 2>'" + streams.file("error") + "' </dev/null")
          .c_str());
  Outcome outcome{WEXITSTATUS(status), readText(streams.file("out")), readText(streams.file("error")), {}};
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.file("."))) {
    if (entry.is_regular_file())
      outcome.files[std::filesystem::relative(entry.path(), folder.file(".")).string()] =
          readText(entry.path().string());
  }
  return outcome;
}

inline std::size_t linesOf(const std::string& text) {
  std::istringstream in(text);
  std::size_t count = 0;
  for (std::string line; std::getline(in, line);) ++count;
  return count;
}

}  // namespace smartmill
