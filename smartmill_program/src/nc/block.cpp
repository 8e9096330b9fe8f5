#include "block.h"

#include <cmath>
#include <string_view>

#include "smartmill_core/error.h"

namespace smartmill::program {
namespace {

using nc::Word;

constexpr int MAX_CODE = 999;

struct Code {
  int code;
  Group group;
};
constexpr Code CODES[] = {
    {0, Group::motion},   {1, Group::motion},    {2, Group::motion},    {3, Group::motion},
    {80, Group::cycle},   {81, Group::cycle},    {82, Group::cycle},    {83, Group::cycle},
    {17, Group::plane},   {18, Group::plane},    {19, Group::plane},    {20, Group::units},
    {21, Group::units},   {40, Group::cutter},   {41, Group::cutter},   {42, Group::cutter},
    {43, Group::length},  {49, Group::length},   {54, Group::work},     {55, Group::work},
    {56, Group::work},    {57, Group::work},     {58, Group::work},     {59, Group::work},
    {61, Group::path},    {64, Group::path},     {90, Group::distance}, {91, Group::distance},
    {93, Group::feed},    {94, Group::feed},     {95, Group::feed},     {98, Group::retract},
    {99, Group::retract}, {4, Group::none},      {28, Group::none},     {52, Group::none},
    {53, Group::none},    {68, Group::rotation}, {69, Group::rotation}, {73, Group::cycle},
    {74, Group::cycle},   {76, Group::cycle},    {84, Group::cycle},    {85, Group::cycle},
    {86, Group::cycle},   {87, Group::cycle},    {88, Group::cycle},    {89, Group::cycle}};
constexpr double FRACTIONS[] = {54.1, 59.1, 59.2, 59.3};  // work offsets
constexpr int FUNCTIONS[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 30, 98, 99};

std::optional<Group> groupOf(const Word& word) {
  for (const double fraction : FRACTIONS)
    if (std::abs(*word.value - fraction) < 1e-9) return Group::work;
  const int code = nc::integer(word, MAX_CODE);
  for (const Code& known : CODES)
    if (known.code == code) return known.group;
  return std::nullopt;
}

}  // namespace

std::string withoutSemicolon(const std::string& line) {
  bool comment = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '(' || line[i] == ')') comment = line[i] == '(';
    if (line[i] == ';' && !comment) return line.substr(0, i);
  }
  return line;
}

std::string commentIn(const std::string& line) {
  const std::size_t begin = line.find_first_of("(;");
  if (begin == std::string::npos) return {};
  const std::size_t end = line[begin] == '(' ? line.find(')', begin) : std::string::npos;
  const std::string text = line.substr(begin + 1, end == std::string::npos ? end : end - begin - 1);
  constexpr const char* BLANKS = " \t\r\n";
  const std::size_t first = text.find_first_not_of(BLANKS);
  return first == std::string::npos ? std::string()
                                    : text.substr(first, text.find_last_not_of(BLANKS) - first + 1);
}

void refuse(const Word& word, const std::string& message) {
  throw Error("column " + std::to_string(word.column) + ": " + message);
}

Block::Block(const std::string& line, const nc::Variables& variables) {
  nc::BlockReader reader(withoutSemicolon(line), MACRO_DIALECT, variables);
  while (const std::optional<Word> word = reader.next()) {
    ++count_;
    if (word->value) add(*word);
  }
}

void Block::add(const Word& word) {
  if (word.address == 'G') {
    const std::optional<Group> group = groupOf(word);
    if (!group) refuse(word, "unknown word " + word.text());
    std::optional<Word>& place = codes_[static_cast<std::size_t>(*group)];
    if (place) refuse(word, word.text() + " and " + place->text() + " in one block");
    place = word;
    // G80 in the block of a motion, as in the first block of most programs; a cycle is itself the motion.
    const std::optional<Word>&motion = codes_[static_cast<std::size_t>(Group::motion)],
          &cycle = codes_[static_cast<std::size_t>(Group::cycle)];
    if (motion && cycle && *cycle->value != 80.0)
      refuse(word, cycle->text() + " and " + motion->text() + " in one block");
  } else if (word.address == 'M') {
    const int code = nc::integer(word, MAX_CODE);
    bool known = false;
    for (const int function : FUNCTIONS) known = known || function == code;
    if (!known) refuse(word, "unknown word " + word.text());
    if (this->function(code)) refuse(word, "two words " + word.text() + " in one block");
    functions_.push_back(word);
  } else {
    std::optional<Word>& place = words_[index(word.address)];
    if (place) refuse(word, std::string("two words ") + word.address + " in one block");
    place = word;
  }
}

const Word* Block::function(int code) const {
  for (const Word& word : functions_)
    if (*word.value == code) return &word;
  return nullptr;
}

const Word* Block::take(char address) {
  taken_[index(address)] = true;
  const std::optional<Word>& word = words_[index(address)];
  return word ? &*word : nullptr;
}

std::optional<double> Block::takeValue(char address) {
  const Word* word = take(address);
  return word ? word->value : std::nullopt;
}

void Block::finish() const {
  const Word* first = nullptr;
  for (std::size_t i = 0; i < words_.size(); ++i)
    if (words_[i] && !taken_[i] && (!first || words_[i]->column < first->column)) first = &*words_[i];
  if (first) refuse(*first, first->text() + " without a code that uses it");
}

std::optional<int> programNumber(const std::string& line) {
  const std::size_t begin = line.find_first_not_of(" \t\r");
  if (begin == std::string::npos || std::string_view("Oo:").find(line[begin]) == std::string_view::npos)
    return std::nullopt;
  nc::BlockReader reader(withoutSemicolon(line), MACRO_DIALECT);
  return nc::integer(*reader.next());
}

bool isTapeMark(const std::string& line) {
  const std::size_t begin = line.find_first_not_of(" \t\r");
  return begin != std::string::npos && line[begin] == '%';
}

}  // namespace smartmill::program
