// Export and import of coefficient records: database.h.
#include <algorithm>
#include <cmath>
#include <sstream>
#include <string_view>

#include "record_fields.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/model/strict_yaml.h"

namespace smartmill::loadmeter {

namespace {

constexpr const char* FORMAT = "smartmill-coefficients/1";

std::string columnName(const NumberField& f) {
  return f.name + "[" + f.unit + "]";
}

// Keys of a file contain the unit: cutting_speed_m_per_s.
std::string keyOf(const NumberField& f) {
  if (f.unit == "1") return f.name;
  std::string key = f.name + "_";
  for (const char c : f.unit) {
    if (c == '/') {
      key += "_per_";
    } else if (c != ' ') {
      key += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
  }
  return key;
}

CoefficientRecord empty() {
  CoefficientRecord record;
  record.set.value = record.set.std_dev = NOT_IDENTIFIED;
  return record;
}

}  // namespace

void exportCsv(const std::vector<CoefficientRecord>& records, const std::string& file) {
  std::string text;
  for (const TextField& f : textFields()) text += (text.empty() ? "" : ",") + f.name;
  for (const NumberField& f : numberFields()) text += "," + columnName(f);
  text += "\n";
  for (CoefficientRecord record : records) {
    std::string row;
    for (const TextField& f : textFields()) row += csvCell(f.at(record)) + ",";
    for (const NumberField& f : numberFields()) row += exactNumber(f.get(record, f.index)) + ",";
    row.back() = '\n';
    text += row;
  }
  writeText(file, text);
}

namespace {

void setCell(const CsvReader& reader, const std::string& column, std::string_view cell,
             CoefficientRecord* record) {
  for (const TextField& f : textFields()) {
    if (f.name == column) f.at(*record) = std::string(cell);
  }
  for (const NumberField& f : numberFields()) {
    if (columnName(f) == column && !cell.empty()) f.set(*record, f.index, reader.number(cell, column));
  }
}

bool isKnown(const std::string& column) {
  const auto& words = textFields();
  const auto& numbers = numberFields();
  return std::any_of(words.begin(), words.end(), [&](const TextField& f) { return f.name == column; }) ||
         std::any_of(numbers.begin(), numbers.end(),
                     [&](const NumberField& f) { return columnName(f) == column; });
}

}  // namespace

std::vector<CoefficientRecord> importCsv(const std::string& file) {
  CsvReader reader(file);
  std::vector<std::string_view> cells;
  if (!reader.next(&cells)) throw Error(file + ": is empty");
  const std::vector<std::string> head(cells.begin(), cells.end());
  for (const std::string& name : head) {
    if (!isKnown(name)) reader.fail("column '" + name + "' is unknown");
  }
  std::vector<CoefficientRecord> records;
  while (reader.nextFilled(&cells)) {
    if (cells.size() != head.size())
      reader.fail(std::to_string(cells.size()) + " values, expected " + std::to_string(head.size()));
    CoefficientRecord record = empty();
    for (std::size_t i = 0; i < head.size(); ++i) setCell(reader, head[i], cells[i], &record);
    records.push_back(record);
  }
  return records;
}

void exportYaml(const std::vector<CoefficientRecord>& records, const std::string& file) {
  std::ostringstream out;
  out << "format: " << FORMAT << "\n" << (records.empty() ? "entries: []\n" : "entries:\n");
  for (CoefficientRecord record : records) {
    out << "- source: " << yamlWord(record.set.source) << "\n";
    for (const TextField& f : textFields()) {
      if (f.name != "source" && !f.at(record).empty())
        out << "  " << f.name << ": " << yamlWord(f.at(record)) << "\n";
    }
    for (const NumberField& f : numberFields()) {
      const double value = f.get(record, f.index);
      const bool count = f.name == "tests" || f.name == "teeth";
      if (!std::isfinite(value) || (f.name == "teeth" && value == 0.0)) continue;
      out << "  " << keyOf(f) << ": ";
      if (count) {
        out << static_cast<long>(value) << "\n";
      } else {
        out << yamlNumber(value, 17) << "\n";
      }
    }
  }
  writeText(file, out.str());
}

std::vector<CoefficientRecord> importYaml(const std::string& file) {
  const StrictYaml root = StrictYaml::fromFile(file);
  root.oneOf("format", {FORMAT});
  std::vector<CoefficientRecord> records;
  for (const StrictYaml& map : root.maps("entries")) {
    CoefficientRecord record = empty();
    for (const TextField& f : textFields()) {
      if (map.has(f.name)) f.at(record) = map.word(f.name);
    }
    for (const NumberField& f : numberFields()) {
      if (const auto value = map.optionalNumber(keyOf(f))) f.set(record, f.index, *value);
    }
    // Earlier form: shop units as in a model file's cutting section.
    if (const auto cutting = map.optionalMap("cutting")) {
      for (const CuttingKey& k : cuttingKeys()) {
        if (const auto v = cutting->optionalNumber(k.key)) record.set.value.*k.coefficient = *v * k.unit;
        if (const auto s = cutting->optionalNumber(std::string(k.key) + "_std")) {
          record.set.std_dev.*k.coefficient = *s * k.unit;
        }
      }
      cutting->finish();
    }
    if (const auto v = map.optionalNumber("viscous_nm_s_per_rad")) record.set.friction_viscous = *v;
    if (const auto v = map.optionalNumber("coulomb_nm")) record.set.friction_coulomb = *v;
    map.finish();
    records.push_back(record);
  }
  root.finish();
  return records;
}

}  // namespace smartmill::loadmeter
