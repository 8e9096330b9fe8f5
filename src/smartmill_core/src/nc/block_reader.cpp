#include "smartmill_core/nc/block_reader.h"

#include <cmath>
#include <string_view>
#include <utility>

namespace smartmill::nc {
namespace {

using Kind = SyntaxError::Kind;

constexpr std::string_view DIGITS = "0123456789";
constexpr std::string_view CONTROL_FLOW[] = {"IF", "WHILE", "GOTO", "DO", "END", "THEN"};

/// "N, G, X or M"
std::string listOf(std::string_view addresses) {
  std::string list;
  for (std::size_t i = 0; i < addresses.size(); ++i) {
    const bool last = i + 1 == addresses.size();
    list += (i == 0 ? "" : last ? " or " : ", ") + std::string(1, addresses[i]);
  }
  return list;
}

}  // namespace

int integer(const Word& word, int most) {
  if (!word.value || !(*word.value >= 0.0 && *word.value <= most) || *word.value != std::floor(*word.value)) {
    throw SyntaxError(Kind::integer, word.column, std::string(1, word.address), word.written,
                      word.text() + ", expected an integer from 0 to " + std::to_string(most));
  }
  return static_cast<int>(*word.value);
}

BlockReader::BlockReader(const std::string& line, const Dialect& dialect, Variables variables)
    : dialect_(dialect), cursor_(line, dialect), values_(cursor_, dialect, std::move(variables)) {
}

bool BlockReader::assigns() const {
  const bool numbered = dialect_.expressions && text().substr(0, 1) == "N";
  const std::size_t at = numbered ? text().find_first_not_of(DIGITS, 1) : 0;
  return at < text().size() && text()[at] == '#' && !(numbered && at == 1);
}

std::optional<Word> BlockReader::next() {
  if (cursor_.done()) return std::nullopt;
  checkAddress();
  Word word;
  word.column = cursor_.column();
  word.address = cursor_.take();
  const std::size_t start = cursor_.position();
  word.value = values_.wordValue(std::string(1, word.address), word.column);
  word.written = cursor_.since(start);
  return word;
}

Assignment BlockReader::assignment() {
  Assignment result;
  if (cursor_.peek() == 'N') result.sequence = integer(*next());
  Word variable;
  variable.column = result.column = cursor_.column();
  variable.address = cursor_.take();
  const std::size_t start = cursor_.position();
  variable.value = values_.wordValue("#", variable.column);
  variable.written = result.written_variable = cursor_.since(start);
  result.variable = integer(variable);
  const bool plain = variable.written.find_first_not_of(DIGITS) == std::string::npos;
  if (!(plain || dialect_.expressions) || cursor_.take() != '=') values_.refuse();
  const std::size_t from = cursor_.position();
  result.value = values_.assignedValue(variable.text() + "=", variable.column);
  result.written_value = cursor_.since(from);
  if (!cursor_.done()) values_.refuse();
  return result;
}

void BlockReader::checkAddress() const {
  for (const std::string_view word : CONTROL_FLOW) {
    if (cursor_.startsWith(word))
      throw SyntaxError(Kind::control_flow, cursor_.column(), std::string(word), "",
                        std::string(word) + " is not supported");
  }
  if (dialect_.addresses.find(cursor_.peek()) != std::string_view::npos) return;
  const std::size_t end = text().find_first_not_of("0123456789.+-", cursor_.position() + 1);
  const std::string word = text().substr(cursor_.position(), end - cursor_.position());
  throw SyntaxError(Kind::address, cursor_.column(), word.substr(0, 1), word.substr(1),
                    "unknown word " + word + ", expected " + listOf(dialect_.addresses));
}

}  // namespace smartmill::nc
