#include "smartmill_core/parameters/parameter_options.h"

#include <stdexcept>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_reader.h"

namespace smartmill {
namespace {

void set(const Parameter& parameter, const std::string& option, const std::string& text) {
  if (auto* const* word = std::get_if<std::string*>(&parameter.address)) {
    **word = text;
    return;
  }
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
    : line_(line), values_(std::make_shared<Values>(Values{table, "", {}})) {
  line.option("--params", values_->file, "parameter file in the format of " + shipped + " (keys below)");
  line.footer("\n" + table.yaml());
  line.afterParsing([values = values_] { values->apply(); });
}

void ParameterOptions::add(const std::string& option, const std::string& key) {
  const Parameter* parameter = values_->table.find(key);
  if (!parameter) throw std::logic_error("no parameter " + key);
  const Given& given = values_->given.emplace_back(Given{option, key});
  line_.option(option, *given.text, parameter->description() + " (" + parameter->value() + ")");
}

void ParameterOptions::Values::apply() const {
  if (!file.empty()) {
    ParameterReader reader = ParameterReader::fromFile(file);
    reader.read(table);
    reader.finish();
  }
  for (const Given& one : given) {
    if (one.text->empty()) continue;
    const Parameter& parameter = *table.find(one.key);
    set(parameter, one.option, *one.text);
    try {
      parameter.check();
    } catch (const Error& error) {
      throw Error(one.option + ": " + error.what());
    }
  }
}

}  // namespace smartmill
