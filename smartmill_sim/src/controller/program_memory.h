#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_focas/server.h"

namespace smartmill::sim {

/// Part programs in the memory of a control, by O number.
class ProgramMemory {
 public:
  static constexpr std::size_t CAPACITY = 512 * 1024;  ///< [byte]

  /// Stores one or several programs "O1234 ... %" of a download; existing ones are replaced.
  /// @return EW_OK, EW_DATA (text without O number), EW_OVRFLOW, EW_BUSY (contains the running program:
  /// nothing is stored).
  focas::EwCode store(const std::string& text, int running, const focas::DateTime& now);
  /// Text of an upload: "%", the programs, "%"; nullopt: no such program.
  std::optional<std::string> fetch(int first, int last) const;
  std::vector<focas::StoredProgram> list() const;
  /// Blocks of a program without the %; nullopt: no such program.
  std::optional<std::string> text(int number) const;
  bool has(int number) const { return programs_.count(number) != 0; }
  void erase(int number) { programs_.erase(number); }

 private:
  struct Program {
    std::string text;  // from the O word on, ends with a newline
    focas::DateTime changed;
  };
  std::map<int, Program> programs_;
};

}  // namespace smartmill::sim
