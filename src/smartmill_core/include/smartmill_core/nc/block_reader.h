#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "smartmill_core/nc/cursor.h"
#include "smartmill_core/nc/dialect.h"
#include "smartmill_core/nc/syntax_error.h"
#include "smartmill_core/nc/value_reader.h"

namespace smartmill::nc {

/// One word of a block.
struct Word {
  char address = '\0';
  std::optional<double> value;  ///< in the units of the text; nullopt: of a vacant variable
  std::string written;          ///< the value as written, without blanks
  std::size_t column = 0;       ///< in the line, from 1

  std::string text() const { return address + written; }
};

/// A block #n=value.
struct Assignment {
  std::optional<int> sequence;  ///< N
  int variable = 0;
  std::optional<double> value;  ///< nullopt: vacant
  std::string written_variable, written_value;
  std::size_t column = 0;  ///< in the line, from 1
};

/// @return the value of a word that is not vacant, an integer from 0 to `most`. @throws SyntaxError
int integer(const Word& word, int most = LARGEST_INTEGER);

/// Reads one block (line) of a program: an assignment, or words one after the other, so that an error is that
/// of the first wrong word. Lower case counts as upper case; comments in parentheses are ignored.
class BlockReader {
 public:
  /// @throws SyntaxError (comment)
  BlockReader(const std::string& line, const Dialect& dialect, Variables variables = {});
  BlockReader(const BlockReader&) = delete;
  BlockReader& operator=(const BlockReader&) = delete;

  /// The significant characters of the line.
  const std::string& text() const { return cursor_.text(); }
  /// Whether assignment() is to be called, and not next().
  bool assigns() const;
  /// @return the next word; nullopt: the end of the block. @throws SyntaxError
  std::optional<Word> next();
  /// @throws SyntaxError
  Assignment assignment();

 private:
  void checkAddress() const;

  Dialect dialect_;
  Cursor cursor_;
  ValueReader values_;
};

}  // namespace smartmill::nc
