#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace smartmill::program {

/// Lines of a file and where its programs (O numbers) begin. Lines behind a second % are dropped.
class ProgramText {
 public:
  /// @throws Error "NAME: line N, ..." on a faulty or repeated O number
  ProgramText(const std::string& text, const std::string& name);

  std::size_t size() const { return lines_.size(); }
  const std::string& line(std::size_t index) const { return lines_[index]; }
  /// Whether a program begins at this line.
  bool begins(std::size_t index) const { return starts_.count(index) != 0; }
  /// First line of a program; nullopt: it is not in the file.
  std::optional<std::size_t> find(int number) const;

 private:
  std::vector<std::string> lines_;
  std::map<int, std::size_t> numbers_;
  std::map<std::size_t, int> starts_;
};

}  // namespace smartmill::program
