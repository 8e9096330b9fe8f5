#include "record_fields.h"

#include <cmath>
#include <cstdint>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

namespace {

using Record = CoefficientRecord;

template <double Record::*member>
NumberField own(const char* name, const char* unit) {
  return {name,
          unit,
          [](const Record& r, std::size_t) { return r.*member; },
          [](Record& r, std::size_t, double v) { r.*member = v; },
          0,
          false};
}
template <double CoefficientSet::*member>
NumberField ofSet(const char* name, const char* unit) {
  return {name,
          unit,
          [](const Record& r, std::size_t) { return r.set.*member; },
          [](Record& r, std::size_t, double v) { r.set.*member = v; },
          0,
          false};
}

// Integers have no NaN; 0 is unknown.
int whole(double v) {
  return std::isfinite(v) ? static_cast<int>(std::lround(v)) : 0;
}

}  // namespace

std::size_t CoefficientRecord::covarianceIndex(std::size_t row, std::size_t column) {
  return row * 6 - row * (row + 1) / 2 + column;
}

const std::vector<TextField>& textFields() {
  static const std::vector<TextField> fields{
      {"tool", [](Record& r) -> std::string& { return r.set.tool; }},
      {"material", [](Record& r) -> std::string& { return r.set.material; }},
      {"source", [](Record& r) -> std::string& { return r.set.source; }},
      {"machine", [](Record& r) -> std::string& { return r.machine; }},
      {"bag", [](Record& r) -> std::string& { return r.bag; }},
      {"version", [](Record& r) -> std::string& { return r.version; }}};
  return fields;
}

const std::vector<NumberField>& numberFields() {
  static const std::vector<NumberField> fields = [] {
    std::vector<NumberField> f;
    f.push_back(ofSet<&CoefficientSet::stamp>("stamp", "s"));
    f.push_back({"tests", "1", [](const Record& r, std::size_t) { return double(r.set.tests); },
                 [](Record& r, std::size_t, double v) { r.set.tests = whole(v); }, 0});
    f.push_back({"teeth", "1", [](const Record& r, std::size_t) { return double(r.teeth); },
                 [](Record& r, std::size_t, double v) { r.teeth = whole(v); }, 0});
    f.push_back(own<&Record::diameter>("diameter", "m"));
    f.push_back(own<&Record::helix>("helix", "rad"));
    f.push_back(own<&Record::rake>("rake", "rad"));
    f.push_back(own<&Record::cutting_speed>("cutting_speed", "m/s"));
    f.push_back(own<&Record::feed_per_tooth>("feed_per_tooth", "m"));
    f.push_back(own<&Record::axial_depth>("axial_depth", "m"));
    f.push_back(own<&Record::entry>("entry", "rad"));
    f.push_back(own<&Record::exit>("exit", "rad"));
    f.push_back(own<&Record::edge_age>("edge_age", "s"));
    f.push_back(ofSet<&CoefficientSet::friction_viscous>("friction_viscous", "N m s/rad"));
    f.push_back(ofSet<&CoefficientSet::friction_coulomb>("friction_coulomb", "N m"));
    const char* names[] = {"ktc", "krc", "kac", "kte", "kre", "kae"};
    for (std::size_t i = 0; i < 6; ++i) {
      f.push_back({names[i], i < 3 ? "N/m2" : "N/m",
                   [](const Record& r, std::size_t k) { return r.set.value.*cuttingKeys()[k].coefficient; },
                   [](Record& r, std::size_t k, double v) { r.set.value.*cuttingKeys()[k].coefficient = v; },
                   i});
    }
    for (std::size_t i = 0; i < 6; ++i) {
      f.push_back(
          {std::string(names[i]) + "_std", i < 3 ? "N/m2" : "N/m",
           [](const Record& r, std::size_t k) { return r.set.std_dev.*cuttingKeys()[k].coefficient; },
           [](Record& r, std::size_t k, double v) { r.set.std_dev.*cuttingKeys()[k].coefficient = v; }, i});
    }
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t j = i; j < 6; ++j) {
        const char* unit = j < 3 ? "N2/m4" : i < 3 ? "N2/m3" : "N2/m2";
        f.push_back({std::string("cov_") + names[i] + "_" + names[j], unit,
                     [](const Record& r, std::size_t k) { return r.covariance[k]; },
                     [](Record& r, std::size_t k, double v) { r.covariance[k] = v; },
                     Record::covarianceIndex(i, j)});
      }
    }
    for (NumberField field :
         {own<&Record::first_stamp>("first_stamp", "s"), own<&Record::flank_wear>("flank_wear", "m"),
          own<&Record::temperature>("temperature", "K")}) {
      field.since_schema_3 = true;
      f.push_back(field);
    }
    return f;
  }();
  return fields;
}

std::string exactNumber(double value) {
  if (!std::isfinite(value)) return {};
  return formatted("%.17g", value);
}

std::string columns() {
  std::string list;
  for (const TextField& f : textFields()) list += (list.empty() ? "" : ", ") + f.name;
  for (const NumberField& f : numberFields()) list += ", " + f.name;
  return list;
}

std::string identityOf(CoefficientRecord record) {
  std::string text;
  for (const TextField& f : textFields()) {
    if (f.name != "version") text += f.at(record) + '\x1f';
  }
  for (const NumberField& f : numberFields()) {
    const double value = f.get(record, f.index);
    if (!f.since_schema_3) {
      text += exactNumber(value) + '\x1f';
    } else if (std::isfinite(value)) {
      text += f.name + exactNumber(value) + '\x1f';
    }
  }
  return identityOf(text);
}

std::string identityOf(const std::string& text) {
  std::uint64_t a = 14695981039346656037ull, b = 1099511628211ull * 2654435761ull;
  for (const char c : text) {
    a = (a ^ static_cast<unsigned char>(c)) * 1099511628211ull;
    b = (b ^ static_cast<unsigned char>(c)) * 1099511628211ull + 0x9e3779b97f4a7c15ull;
  }
  return formatted("%016llx%016llx", static_cast<unsigned long long>(a), static_cast<unsigned long long>(b));
}

std::string RecordKind::columns(const std::string& prefix) const {
  std::string list = prefix + "identity";
  if (by_speed) list += ", " + prefix + "speed_bucket";
  for (const std::string& name : words) list += ", " + prefix + name;
  for (const std::string& name : numbers) list += ", " + prefix + name;
  return list;
}

const RecordKind& coefficientKind() {
  static const RecordKind kind = [] {
    RecordKind k;
    k.table = "coefficients";
    k.by_speed = true;
    for (const TextField& f : textFields()) k.words.push_back(f.name);
    for (const NumberField& f : numberFields()) k.numbers.push_back(f.name);
    return k;
  }();
  return kind;
}

const std::vector<RecordKind>& recordKinds() {
  static const std::vector<RecordKind> kinds{coefficientKind(), improvementKind(), healthKind(),
                                             inspectionKind()};
  return kinds;
}

Row rowOf(CoefficientRecord record) {
  if (!std::isfinite(record.set.stamp)) throw Error("stamp of a record: expected a finite number");
  Row row;
  row.identity = identityOf(record);
  row.speed_bucket = bucketOf(record.cutting_speed);
  for (const TextField& f : textFields()) row.words.push_back(f.at(record));
  for (const NumberField& f : numberFields()) row.numbers.push_back(f.get(record, f.index));
  return row;
}

void readRow(const Row& row, CoefficientRecord* record) {
  for (std::size_t i = 0; i < row.words.size(); ++i) textFields()[i].at(*record) = row.words[i];
  for (std::size_t i = 0; i < row.numbers.size(); ++i)
    numberFields()[i].set(*record, numberFields()[i].index, row.numbers[i]);
}

int bucketOf(double cutting_speed) {
  if (!(cutting_speed > 0.0)) return NO_SPEED;
  return static_cast<int>(std::floor(2.0 * std::log2(cutting_speed)));
}

}  // namespace smartmill::loadmeter
