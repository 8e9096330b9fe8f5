// Export and import of coefficient records: database.h.
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

#include "record_fields.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/model/strict_yaml.h"

namespace smartmill::loadmeter {

namespace {

constexpr const char* FORMAT = "smartmill-coefficients/1";

std::string columnName(const NumberField& f) {
  return f.name + "[" + f.unit + "]";
}

// Key of a file carries its unit: cutting_speed_m_per_s.
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

std::string quoted(const std::string& word) {
  if (word.find_first_of(",\"\n\r") == std::string::npos) return word;
  std::string out = "\"";
  for (const char c : word) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

// One record of a CSV file, quotes and line breaks within them included. @return false at the end.
bool readRow(std::istream& stream, std::vector<std::string>* cells, int* lines) {
  cells->clear();
  std::string cell;
  bool inside = false, any = false;
  for (int c = stream.get(); c != EOF; c = stream.get()) {
    any = true;
    if (inside) {
      if (c == '\n') ++*lines;
      if (c != '"') {
        cell += static_cast<char>(c);
      } else if (stream.peek() == '"') {
        cell += static_cast<char>(stream.get());
      } else {
        inside = false;
      }
    } else if (c == '"') {
      inside = true;
    } else if (c == ',') {
      cells->push_back(cell);
      cell.clear();
    } else if (c == '\n') {
      break;
    } else if (c != '\r') {
      cell += static_cast<char>(c);
    }
  }
  if (!any) return false;
  ++*lines;
  cells->push_back(cell);
  return true;
}

CoefficientRecord empty() {
  CoefficientRecord record;
  record.set.value = record.set.std_dev = NOT_IDENTIFIED;
  return record;
}

void close(std::ofstream& stream, const std::string& file) {
  stream.close();
  if (!stream) throw Error(file + ": cannot be written");
}

}  // namespace

void exportCsv(const std::vector<CoefficientRecord>& records, const std::string& file) {
  std::ofstream out(file, std::ios::binary);
  std::string head;
  for (const WordField& f : wordFields()) head += (head.empty() ? "" : ",") + f.name;
  for (const NumberField& f : numberFields()) head += "," + columnName(f);
  out << head << "\n";
  for (CoefficientRecord record : records) {
    std::string row;
    for (const WordField& f : wordFields()) row += quoted(f.at(record)) + ",";
    for (const NumberField& f : numberFields()) row += exactNumber(f.get(record, f.index)) + ",";
    row.pop_back();
    out << row << "\n";
  }
  close(out, file);
}

std::vector<CoefficientRecord> importCsv(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw Error(file + ": cannot be read");
  int line = 0;
  std::vector<std::string> head, cells;
  if (!readRow(stream, &head, &line)) throw Error(file + ": empty");
  const auto isKnown = [](const std::string& name) {
    for (const WordField& f : wordFields()) {
      if (f.name == name) return true;
    }
    for (const NumberField& f : numberFields()) {
      if (columnName(f) == name) return true;
    }
    return false;
  };
  for (const std::string& name : head) {
    if (!isKnown(name)) throw Error(file + ": line 1: column '" + name + "' is not known");
  }
  std::vector<CoefficientRecord> records;
  while (readRow(stream, &cells, &line)) {
    if (cells.size() == 1 && cells[0].empty()) continue;
    const std::string where = file + ": line " + std::to_string(line) + ": ";
    if (cells.size() != head.size()) {
      throw Error(where + std::to_string(cells.size()) + " values, " + std::to_string(head.size()) +
                  " are due");
    }
    CoefficientRecord record = empty();
    for (std::size_t i = 0; i < head.size(); ++i) {
      for (const WordField& f : wordFields()) {
        if (f.name == head[i]) f.at(record) = cells[i];
      }
      for (const NumberField& f : numberFields()) {
        if (columnName(f) != head[i] || cells[i].empty()) continue;
        double value = 0.0;
        const char* end = cells[i].data() + cells[i].size();
        const auto parsed = std::from_chars(cells[i].data(), end, value);
        if (parsed.ec != std::errc() || parsed.ptr != end || !std::isfinite(value)) {
          throw Error(where + head[i] + ": '" + cells[i] + "' is not a number");
        }
        f.set(record, f.index, value);
      }
    }
    records.push_back(record);
  }
  return records;
}

void exportYaml(const std::vector<CoefficientRecord>& records, const std::string& file) {
  std::ofstream out(file, std::ios::binary);
  out << "format: " << FORMAT << "\n" << (records.empty() ? "entries: []\n" : "entries:\n");
  for (CoefficientRecord record : records) {
    out << "- source: " << yamlWord(record.set.source) << "\n";
    for (const WordField& f : wordFields()) {
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
  close(out, file);
}

std::vector<CoefficientRecord> importYaml(const std::string& file) {
  const StrictYaml root = StrictYaml::fromFile(file);
  root.oneOf("format", {FORMAT});
  std::vector<CoefficientRecord> records;
  for (const StrictYaml& map : root.maps("entries")) {
    CoefficientRecord record = empty();
    for (const WordField& f : wordFields()) {
      if (map.has(f.name)) f.at(record) = map.word(f.name);
    }
    for (const NumberField& f : numberFields()) {
      if (const auto value = map.optionalNumber(keyOf(f))) f.set(record, f.index, *value);
    }
    // The older form: shop units in a model file's cutting section.
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
