#include "smartmill_core/parameters/parameter_table.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/strict_yaml.h"

namespace smartmill {
namespace {

constexpr std::size_t WIDTH = 140;       // of a line of the file
constexpr std::size_t LAST_COLUMN = 36;  // of comments; a longer value moves its comment to the right

template <class Numbers>
std::string listed(const Numbers& numbers) {
  std::vector<std::string> words;
  for (const double number : numbers) words.push_back(yamlNumberExact(number));
  return "[" + joined(words) + "]";
}

std::string written(double value) {
  return yamlNumberExact(value);
}
std::string written(int value) {
  return std::to_string(value);
}
std::string written(std::uint64_t value) {
  return std::to_string(value);
}
std::string written(bool value) {
  return value ? "true" : "false";
}
std::string written(const std::string& value) {
  return yamlWord(value);
}
std::string written(const std::vector<double>& values) {
  return listed(values);
}
std::string written(const std::array<double, 3>& values) {
  return listed(values);
}

// Numbers of a value, for the bounds; none of text and flags.
std::vector<double> numbers(const Parameter::Address& address) {
  if (const auto* value = std::get_if<double*>(&address)) return {**value};
  if (const auto* value = std::get_if<int*>(&address)) return {static_cast<double>(**value)};
  if (const auto* value = std::get_if<std::uint64_t*>(&address)) return {static_cast<double>(**value)};
  if (const auto* value = std::get_if<std::vector<double>*>(&address)) return **value;
  if (const auto* value = std::get_if<std::array<double, 3>*>(&address))
    return {(*value)->begin(), (*value)->end()};
  return {};
}

// "> 0", "0..1", "0 <= value < 1"; empty without bounds.
std::string bounds(const Range& range) {
  const std::string text = range.text();
  if (text == "finite") return {};
  const bool closed = !range.low_open && !range.high_open;
  const bool both = text.find("value") != std::string::npos;
  return closed && both ? shortNumber(range.low) + ".." + shortNumber(range.high) : text;
}

// Wraps a comment within the width; further lines are indented like the first.
void wrap(std::ostream& out, const std::string& text, std::string begin) {
  const std::string further = std::string(begin.size(), ' ') + "# ";
  begin += "# ";
  std::istringstream words(text);
  std::string word, line = begin;
  bool first = true;
  while (words >> word) {
    if (!first && line.size() + 1 + word.size() > WIDTH) {
      out << line << "\n";
      line = further;
      first = true;
    }
    line += (first ? "" : " ") + word;
    first = false;
  }
  out << line << "\n";
}

}  // namespace

std::string Parameter::value() const {
  return std::visit([](const auto* it) { return written(*it); }, address);
}

std::string Parameter::description() const {
  const std::string range_text = bounds(range);
  return (unit.empty() ? "" : "[" + unit + "] ") + (range_text.empty() ? "" : range_text + ", ") + comment;
}

void Parameter::check() const {
  for (const double number : numbers(address)) {
    if (!range.contains(number)) throw Error(key + ": " + outOfRange(number, range, unit));
  }
  const auto* text = std::get_if<std::string*>(&address);
  if (!text || words.empty() || std::find(words.begin(), words.end(), **text) != words.end()) return;
  throw Error(key + ": '" + **text + "' is not one of " + choices());
}

std::string Parameter::choices() const {
  return joined(words, " | ");
}

void ParameterTable::section(const std::string& text) {
  sections_.push_back({parameters_.size(), text});
}

void ParameterTable::add(Parameter parameter) {
  parameter.key = prefix_ + parameter.key;
  if (find(parameter.key)) throw std::logic_error("parameter " + parameter.key + " is declared twice");
  parameters_.push_back(std::move(parameter));
}

void ParameterTable::number(const std::string& key, double& value, const std::string& unit,
                            const Range& range, const std::string& comment) {
  add({key, unit, comment, &value, range});
}

void ParameterTable::number(const std::string& key, int& value, const std::string& unit, const Range& range,
                            const std::string& comment) {
  add({key, unit, comment, &value, range});
}

void ParameterTable::number(const std::string& key, std::uint64_t& value, const std::string& unit,
                            const Range& range, const std::string& comment) {
  add({key, unit, comment, &value, range});
}

void ParameterTable::list(const std::string& key, std::vector<double>& values, const std::string& unit,
                          const Range& range, const std::string& comment) {
  add({key, unit, comment, &values, range});
}

void ParameterTable::list(const std::string& key, std::array<double, 3>& values, const std::string& unit,
                          const Range& range, const std::string& comment) {
  add({key, unit, comment, &values, range});
}

void ParameterTable::flag(const std::string& key, bool& value, const std::string& comment) {
  add({key, "", comment, &value});
}

void ParameterTable::text(const std::string& key, std::string& value, const std::string& comment) {
  add({key, "", comment, &value});
}

void ParameterTable::choice(const std::string& key, std::string& value, const std::vector<std::string>& words,
                            const std::string& comment) {
  add({key, "", comment, &value, {}, words});
}

void ParameterTable::atLaunch(const std::string& key, std::string& value, const std::string& comment) {
  add({key, "", comment, &value, {}, {}, Parameter::Where::at_launch});
}

void ParameterTable::atLaunch(const std::string& key, bool& value, const std::string& comment) {
  add({key, "", comment, &value, {}, {}, Parameter::Where::at_launch});
}

void ParameterTable::internal(const std::string& key, double& value, const std::string& unit,
                              const Range& range) {
  add({key, unit, "", &value, range, {}, Parameter::Where::internal});
}

const Parameter* ParameterTable::find(const std::string& key) const {
  for (const Parameter& parameter : parameters_) {
    if (parameter.key == key) return &parameter;
  }
  return nullptr;
}

void ParameterTable::check() const {
  for (const Parameter& parameter : parameters_) parameter.check();
}

std::string ParameterTable::yaml() const {
  std::size_t column = 0;
  for (const Parameter& parameter : parameters_) {
    if (parameter.where != Parameter::Where::shipped) continue;
    const std::size_t length = parameter.key.size() + 2 + parameter.value().size() + 1;
    if (length <= LAST_COLUMN) column = std::max(column, length);
  }
  std::ostringstream out;
  if (!title_.empty()) wrap(out, title_, "");
  out << "# A number that may carry a fraction needs a point, its exponent a sign: 1.0e-2, never 1e-2 (a "
         "word to YAML).\n";
  auto section = sections_.begin();
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    for (; section != sections_.end() && section->first == i; ++section) {
      out << "\n";
      if (!section->text.empty()) wrap(out, section->text, "");
    }
    const Parameter& parameter = parameters_[i];
    if (parameter.where == Parameter::Where::internal) continue;
    if (parameter.where == Parameter::Where::at_launch) {
      wrap(out, parameter.key + ": set by the launch file; " + parameter.description(), "");
      continue;
    }
    std::string begin = parameter.key + ": " + parameter.value() + " ";
    if (begin.size() < column) begin.resize(column, ' ');
    wrap(out, parameter.description(), begin);
  }
  return out.str();
}

}  // namespace smartmill
