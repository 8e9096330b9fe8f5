#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_focas/server.h"

namespace smartmill::sim {

/// Part programs in the memory of a control, by O number; one is selected. `runs`: whether it runs, so that
/// it must not change.
class ProgramMemory {
 public:
  /// @param capacity [byte]
  explicit ProgramMemory(std::size_t capacity) : capacity_(capacity) {}

  /// Stores one or several programs "O1234 ... %" of a download; existing ones are replaced.
  /// @return EW_OK, EW_DATA (text without O number), EW_OVRFLOW, EW_BUSY (contains the running program:
  /// nothing is stored).
  focas::EwCode store(const std::string& text, bool runs, const focas::DateTime& now);
  /// @return EW_OK, EW_DATA (no such program), EW_BUSY.
  focas::EwCode select(int number, bool runs);
  focas::EwCode erase(int number, bool runs);
  int selected() const { return selected_; }  ///< 0: none
  /// Text of an upload: "%", the programs, "%"; nullopt: no such program.
  std::optional<std::string> fetch(int first, int last) const;
  std::vector<focas::StoredProgram> list() const;
  /// Blocks of a program without the %; nullopt: no such program.
  std::optional<std::string> text(int number) const;

 private:
  struct Program {
    std::string text;  // from the O word on, ends with a newline
    focas::DateTime changed;
  };
  std::size_t capacity_;
  std::map<int, Program> programs_;
  int selected_ = 0;
};

}  // namespace smartmill::sim
