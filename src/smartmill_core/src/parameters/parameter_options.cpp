#include "smartmill_core/parameters/parameter_options.h"

#include <stdexcept>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_reader.h"

namespace smartmill {
namespace {

void set(const Parameter& parameter, const std::string& option, const std::string& text) {
  std::size_t used = 0;
  double number = 0.0;
  try {
    number = std::stod(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used != text.size()) throw Error(option + ": '" + text + "' is not a number");
  if (const auto* address = std::get_if<double*>(&parameter.address)) {
    **address = number;
  } else {
    int* const integer = std::get<int*>(parameter.address);
    *integer = static_cast<int>(number);
    if (*integer != number) throw Error(option + ": '" + text + "' is not an integer");
  }
}

}  // namespace

ParameterOptions::ParameterOptions(CommandLine& line, const ParameterTable& table, const std::string& shipped)
    : line_(line), table_(table) {
  line.option("--params", file_, "parameter file in the format of " + shipped + " (keys below)");
  line.footer("\n" + table.yaml());
}

void ParameterOptions::add(const std::string& option, const std::string& key) {
  const Parameter* parameter = table_.find(key);
  if (!parameter) throw std::logic_error("no parameter " + key);
  given_.push_back({option, key});
  line_.option(option, *given_.back().text, parameter->description() + " (" + parameter->value() + ")");
}

void ParameterOptions::apply() {
  if (!file_.empty()) {
    ParameterReader reader = ParameterReader::fromFile(file_);
    reader.read(table_);
    reader.finish();
  }
  for (const Given& given : given_) {
    if (given.text->empty()) continue;
    const Parameter& parameter = *table_.find(given.key);
    set(parameter, given.option, *given.text);
    try {
      parameter.check();
    } catch (const Error& error) {
      throw Error(given.option + ": " + error.what());
    }
  }
}

}  // namespace smartmill
