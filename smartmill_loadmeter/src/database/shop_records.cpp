#include "smartmill_loadmeter/database/shop_records.h"

#include <sys/stat.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>

#include <nlohmann/json.hpp>

#include "record_fields.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/signal/inspection_feature.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

using Json = nlohmann::ordered_json;

template <typename R>
struct TextColumn {
  const char* name = nullptr;
  std::string R::*at = nullptr;
  bool identifying = true;  ///< part of the record's identity
};
template <typename R>
struct NumberColumn {
  const char* name = nullptr;
  double R::*at = nullptr;
  bool identifying = true;
};

using I = ModelImprovement;
// Report path, stamp and version are not part of the identity: a copy of a report is the same record.
const std::vector<TextColumn<I>> IMPROVEMENT_WORDS{
    {"machine", &I::machine}, {"verdict", &I::verdict},      {"effects", &I::effects},
    {"rivals", &I::rivals},   {"resembles", &I::resembles},  {"tests", &I::tests},
    {"asked", &I::asked},     {"report", &I::report, false}, {"version", &I::version, false}};
const std::vector<NumberColumn<I>> IMPROVEMENT_NUMBERS{{"stamp", &I::stamp, false},
                                                       {"fit_before", &I::fit_before},
                                                       {"fit_after", &I::fit_after},
                                                       {"heldout_before", &I::heldout_before},
                                                       {"heldout_after", &I::heldout_after}};
using H = HealthRecord;
const std::vector<TextColumn<H>> HEALTH_WORDS{{"machine", &H::machine},
                                              {"measured", &H::measured},
                                              {"quantity", &H::quantity},
                                              {"bag", &H::bag},
                                              {"version", &H::version, false}};
const std::vector<NumberColumn<H>> HEALTH_NUMBERS{{"stamp", &H::stamp},           {"days", &H::days},
                                                  {"first", &H::first},           {"now", &H::now},
                                                  {"deviations", &H::deviations}, {"drifted", &H::drifted}};

using P = InspectionRecord;
// What follows from other records or the machine's state is not part of the identity.
const std::vector<TextColumn<P>> INSPECTION_WORDS{
    {"machine", &P::machine},   {"tool", &P::tool},
    {"material", &P::material}, {"condition", &P::condition},
    {"kind", &P::kind},         {"direction", &P::direction},
    {"bag", &P::bag, false},    {"version", &P::version, false}};
const std::vector<NumberColumn<P>> INSPECTION_NUMBERS{{"stamp", &P::stamp, false},
                                                      {"diameter", &P::diameter},
                                                      {"nominal", &P::nominal},
                                                      {"measured", &P::measured},
                                                      {"std_dev", &P::std_dev},
                                                      {"deflection", &P::deflection, false},
                                                      {"deflection_std", &P::deflection_std, false},
                                                      {"cut_time", &P::cut_time},
                                                      {"machine_temperature", &P::machine_temperature, false},
                                                      {"part_temperature", &P::part_temperature},
                                                      {"part_expansion", &P::part_expansion},
                                                      {"edge_age", &P::edge_age, false}};

template <typename R>
RecordKind kindOf(const char* table, const std::vector<TextColumn<R>>& words,
                  const std::vector<NumberColumn<R>>& numbers) {
  RecordKind kind;
  kind.table = table;
  for (const auto& w : words) kind.words.push_back(w.name);
  for (const auto& n : numbers) kind.numbers.push_back(n.name);
  return kind;
}

template <typename R>
Row rowFrom(const R& record, const std::vector<TextColumn<R>>& words,
            const std::vector<NumberColumn<R>>& numbers) {
  if (!std::isfinite(record.stamp)) throw Error("stamp of a record: expected a finite number");
  Row row;
  std::string content;
  for (const auto& w : words) {
    row.words.push_back(record.*w.at);
    if (w.identifying) content += record.*w.at + '\x1f';
  }
  for (const auto& n : numbers) {
    row.numbers.push_back(record.*n.at);
    if (n.identifying) content += exactNumber(record.*n.at) + '\x1f';
  }
  row.identity = identityOf(content);
  return row;
}

template <typename R>
void readColumns(const Row& row, const std::vector<TextColumn<R>>& words,
                 const std::vector<NumberColumn<R>>& numbers, R* record) {
  for (std::size_t i = 0; i < words.size(); ++i) record->*words[i].at = row.words[i];
  for (std::size_t i = 0; i < numbers.size(); ++i) record->*numbers[i].at = row.numbers[i];
}

// Adds the condition in the keys of a campaign's tests, as the report's suggested_cut.
void addCondition(const CampaignTest& test, Json* json) {
  (*json)["spindle_speed_rpm"] = units::rpmFromRadPerSec(test.spindle_speed);
  if (!test.engagement) return;
  (*json)["feed_per_tooth_mm"] = test.engagement->feed_per_tooth / units::MM;
  (*json)["axial_depth_mm"] = test.engagement->axial_depth / units::MM;
  (*json)["entry_deg"] = units::degFromRad(test.engagement->entry);
  (*json)["exit_deg"] = units::degFromRad(test.engagement->exit);
}

// List of the tests with the gaps of their channels.
std::string testsOf(const Json& gaps, const std::string& campaign) {
  std::map<std::string, Json> conditions;
  if (!campaign.empty()) {
    for (const CampaignTest& t : readCampaign(campaign).tests) addCondition(t, &conditions[t.name]);
  }
  std::map<std::string, std::size_t> at;
  Json list = Json::array();
  for (const Json& gap : gaps) {
    const std::string name = gap.at("test");
    if (at.try_emplace(name, list.size()).second) {
      list.push_back({{"test", name}, {"heldout", gap.at("heldout")}, {"gaps", Json::object()}});
      if (const auto known = conditions.find(name); known != conditions.end())
        list.back().update(known->second);
    }
    list[at[name]]["gaps"][gap.at("channel").get<std::string>()] = {gap.at("before"), gap.at("after")};
  }
  return list.dump();
}

ModelImprovement improvementOf(const Json& report, const std::string& campaign) {
  const Json& format = report.at("format");
  if (format != "smartmill-report/2" && format != "smartmill-report/1")
    throw Error("format " + format.dump() + ", expected \"smartmill-report/2\" or \"smartmill-report/1\"");
  ModelImprovement i;
  i.verdict = report.at("verdict");
  i.effects = report.at("effects").dump();
  i.rivals = report.at("not_separable").dump();
  i.resembles = report.at("resembles").dump();
  i.tests = testsOf(report.at("gaps"), campaign);
  if (report.at("suggested_test").is_string()) i.asked = report.at("suggested_test");
  const Json &before = report.at("gap").at("before"), &after = report.at("gap").at("after");
  i.fit_before = before.at("fit");
  i.fit_after = after.at("fit");
  i.heldout_before = before.at("heldout");
  i.heldout_after = after.at("heldout");
  return i;
}

}  // namespace

const RecordKind& improvementKind() {
  static const RecordKind kind = kindOf("improvements", IMPROVEMENT_WORDS, IMPROVEMENT_NUMBERS);
  return kind;
}

const RecordKind& healthKind() {
  static const RecordKind kind = kindOf("health", HEALTH_WORDS, HEALTH_NUMBERS);
  return kind;
}

const RecordKind& inspectionKind() {
  static const RecordKind kind = kindOf("inspections", INSPECTION_WORDS, INSPECTION_NUMBERS);
  return kind;
}

Row rowOf(const ModelImprovement& improvement) {
  return rowFrom(improvement, IMPROVEMENT_WORDS, IMPROVEMENT_NUMBERS);
}
Row rowOf(const HealthRecord& health) {
  return rowFrom(health, HEALTH_WORDS, HEALTH_NUMBERS);
}
Row rowOf(const InspectionRecord& inspection) {
  return rowFrom(inspection, INSPECTION_WORDS, INSPECTION_NUMBERS);
}
void readRow(const Row& row, ModelImprovement* improvement) {
  readColumns(row, IMPROVEMENT_WORDS, IMPROVEMENT_NUMBERS, improvement);
}
void readRow(const Row& row, HealthRecord* health) {
  readColumns(row, HEALTH_WORDS, HEALTH_NUMBERS, health);
}
void readRow(const Row& row, InspectionRecord* inspection) {
  readColumns(row, INSPECTION_WORDS, INSPECTION_NUMBERS, inspection);
}

namespace {

// Name and condition as text.
std::string nameOf(const Json& test) {
  const auto number = [&test](const char* key) { return test.at(key).get<double>(); };
  const std::string name = test.at("test");
  if (test.contains("axial_depth_mm")) {
    return name + formatted(" (a cut at %.0f rpm, %.3g mm per tooth, %.3g mm deep, from %.0f to %.0f deg)",
                            number("spindle_speed_rpm"), number("feed_per_tooth_mm"),
                            number("axial_depth_mm"), number("entry_deg"), number("exit_deg"));
  }
  if (test.contains("spindle_speed_rpm"))
    return name + formatted(" (no cut, %.0f rpm)", number("spindle_speed_rpm"));
  return name;
}

// Visits a list of a record. @throws Error with the machine's name.
template <typename Work>
void eachOf(const ModelImprovement& improvement, const std::string& list, const Work& work) {
  try {
    for (const Json& item : Json::parse(list)) work(item);
  } catch (const Json::exception& error) {
    throw Error("explanation of '" + improvement.machine + "': " + error.what());
  }
}

FoundCause causeOf(const Json& effect) {
  FoundCause cause;
  cause.name = effect.at("name");
  cause.delta_bic = effect.at("delta_bic");
  cause.confidence = effect.at("confidence");
  cause.parameters = reportedParameters(effect.at("parameters"));
  return cause;
}

}  // namespace

double InspectionRecord::deviation() const {
  return dimensionAtReference(measured, part_temperature, part_expansion) - nominal;
}

std::string FoundCause::text() const {
  return name + (parameters.empty() ? "" : ": " + textOf(parameters));
}

std::vector<FoundCause> causesOf(const ModelImprovement& improvement) {
  std::vector<FoundCause> causes;
  eachOf(improvement, improvement.effects, [&](const Json& effect) {
    if (!effect.contains("form")) causes.push_back(causeOf(effect));
  });
  return causes;
}

std::vector<TestEvidence> evidenceOf(const ModelImprovement& improvement) {
  std::vector<TestEvidence> tests;
  eachOf(improvement, improvement.tests, [&](const Json& t) {
    tests.push_back({nameOf(t), {}});
    for (const auto& [channel, gap] : t.at("gaps").items())
      tests.back().gaps.push_back({channel, gap.at(0), gap.at(1)});
  });
  return tests;
}

ModelImprovement readImprovement(const std::string& report, const std::string& campaign) {
  const std::string file = std::filesystem::is_directory(report) ? report + "/report.json" : report;
  std::ifstream in(file);
  struct stat state {};
  if (!in || stat(file.c_str(), &state) != 0) throw Error(file + ": cannot be read");
  try {
    ModelImprovement improvement = improvementOf(Json::parse(in), campaign);
    improvement.report = file;
    improvement.stamp = static_cast<double>(state.st_mtime);
    return improvement;
  } catch (const Json::exception& error) {
    throw Error(file + ": " + error.what());
  }
}

std::vector<HealthRecord> readHealth(const std::string& file) {
  CsvReader reader(file);
  std::vector<std::string_view> cells;
  if (!reader.next(&cells)) throw Error(file + ": is empty");
  std::map<std::string, std::size_t> columns;
  for (std::size_t i = 0; i < cells.size(); ++i) columns[std::string(cells[i])] = i;
  for (const char* name :
       {"measured", "bag", "days", "quantity", "first", "now", "deviations", "drifted", "stamp"}) {
    if (!columns.count(name)) reader.fail(std::string("column '") + name + "' is missing");
  }
  std::vector<HealthRecord> records;
  while (reader.nextFilled(&cells)) {
    if (cells.size() != columns.size())
      reader.fail(std::to_string(cells.size()) + " values, expected " + std::to_string(columns.size()));
    const auto word = [&](const char* name) { return std::string(cells[columns[name]]); };
    const auto number = [&](const char* name) {
      const std::string_view cell = cells[columns[name]];
      return cell.empty() ? HealthRecord::UNKNOWN : reader.number(cell, name);
    };
    HealthRecord r;
    r.measured = word("measured");
    r.quantity = word("quantity");
    r.bag = word("bag");
    r.stamp = number("stamp");
    if (!std::isfinite(r.stamp)) reader.fail("stamp: expected a number");
    r.days = number("days");
    r.first = number("first");
    r.now = number("now");
    r.deviations = number("deviations");
    r.drifted = word("drifted") == "true" ? 1.0 : 0.0;
    records.push_back(r);
  }
  return records;
}

}  // namespace smartmill::loadmeter
