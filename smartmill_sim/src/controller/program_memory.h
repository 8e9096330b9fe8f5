#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_focas/server.h"

namespace smartmill::sim {

/// Part programs that a control keeps, by O number.
class ProgramMemory {
 public:
  static constexpr std::size_t CAPACITY = 512 * 1024;  ///< [byte]

  /// One or several programs "O1234 ... %" as a download brings them; one that is there is replaced.
  /// @return EW_OK, EW_DATA (a text without O number), EW_OVRFLOW, EW_BUSY (it is the running one: nothing is
  /// stored).
  focas::EwCode store(const std::string& text, int running, const focas::DateTime& now);
  /// As an upload brings them: "%", the programs, "%". Nothing: there is none with these numbers.
  std::optional<std::string> fetch(int first, int last) const;
  std::vector<focas::StoredProgram> list() const;
  /// Blocks of a program without the %. Nothing: there is none.
  std::optional<std::string> text(int number) const;
  bool has(int number) const { return programs_.count(number) != 0; }
  void erase(int number) { programs_.erase(number); }

 private:
  struct Program {
    std::string text;  // from O on, ends with a line end
    focas::DateTime changed;
  };
  std::map<int, Program> programs_;
};

}  // namespace smartmill::sim
