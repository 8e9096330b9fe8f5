#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "smartmill_core/nc/block_reader.h"

namespace smartmill::program {

/// Modal groups of G codes; at most one code of each in a block.
enum class Group {
  none,  // G4, G28, G52, G53
  motion,
  cycle,
  plane,
  distance,
  feed,
  units,
  cutter,
  length,
  work,
  retract,
  path,
  rotation,
  count
};

/// Words with expressions of macro B.
inline constexpr nc::Dialect MACRO_DIALECT{"O:NGXYZIJKRPQLHDTFSM", std::string_view(" \t\n\v\f\r\0", 7),
                                           false, true, true};

/// Without the comment of LinuxCNC that begins with ';' (on a Fanuc control ';' is the end of the block).
std::string withoutSemicolon(const std::string& line);

/// Text of the first comment of a line, without blanks around it; empty: there is none.
std::string commentIn(const std::string& line);

/// @throws Error "column C: message"
[[noreturn]] void refuse(const nc::Word& word, const std::string& message);

/// The words of a block. A word that no code of the block uses is an error.
class Block {
 public:
  /// A word whose variable is vacant does not count.
  /// @throws Error on an unknown word, and on two words of one address or codes of one group.
  explicit Block(const std::string& line, const nc::Variables& variables = {});

  bool empty() const { return count_ == 0; }
  /// Whether it has no word but N.
  bool hasOnlyNumber() const { return count_ == 0 || (count_ == 1 && has('N')); }
  /// The code of a group, as its word.
  const std::optional<nc::Word>& code(Group group) const { return codes_[static_cast<std::size_t>(group)]; }
  const std::vector<nc::Word>& functions() const { return functions_; }  ///< M
  const nc::Word* function(int code) const;

  bool has(char address) const { return words_[index(address)].has_value(); }
  /// The word of an address, which then counts as used; nullptr: absent.
  const nc::Word* take(char address);
  std::optional<double> takeValue(char address);
  /// @throws Error naming the first word that was not taken
  void finish() const;

 private:
  static std::size_t index(char address) {
    return address == ':' ? 26 : static_cast<std::size_t>(address - 'A');
  }
  void add(const nc::Word& word);

  std::array<std::optional<nc::Word>, static_cast<std::size_t>(Group::count)> codes_;
  std::array<std::optional<nc::Word>, 27> words_;
  std::array<bool, 27> taken_{};
  std::vector<nc::Word> functions_;
  std::size_t count_ = 0;  // of words
};

/// O or : number of a line that begins a program or subprogram. @throws Error
std::optional<int> programNumber(const std::string& line);
/// Whether a line is the % before or after the programs.
bool isTapeMark(const std::string& line);

}  // namespace smartmill::program
