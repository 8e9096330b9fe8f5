#include "smartmill_loadmeter/database.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::loadmeter {

namespace {

constexpr const char* FORMAT = "smartmill-coefficients/1";

CoefficientSet readEntry(const StrictYaml& map) {
  CoefficientSet entry;
  if (map.has("tool")) entry.tool = map.word("tool");
  if (map.has("material")) entry.material = map.word("material");
  entry.source = map.oneOf("source", {"load_meter", "force"});
  entry.stamp = map.number("stamp_s");
  entry.tests = map.integer("tests", 0, 1000000);
  entry.friction_viscous = map.optionalNumber("viscous_nm_s_per_rad").value_or(NOT_A_NUMBER);
  entry.friction_coulomb = map.optionalNumber("coulomb_nm").value_or(NOT_A_NUMBER);
  const StrictYaml cutting = map.map("cutting");
  for (const CuttingKey& k : cuttingKeys()) {
    const auto value = cutting.optionalNumber(k.key),
               std_dev = cutting.optionalNumber(std::string(k.key) + "_std");
    entry.value.*k.coefficient = value ? *value * k.unit : NOT_A_NUMBER;
    entry.std_dev.*k.coefficient = std_dev ? *std_dev * k.unit : NOT_A_NUMBER;
  }
  cutting.finish();
  map.finish();
  return entry;
}

}  // namespace

CoefficientDatabase::CoefficientDatabase(std::string file) : file_(std::move(file)) {
  if (file_.empty() || !std::filesystem::exists(file_)) return;
  const StrictYaml root = StrictYaml::fromFile(file_);
  root.oneOf("format", {FORMAT});
  for (const StrictYaml& map : root.maps("entries")) entries_.push_back(readEntry(map));
  root.finish();
}

void CoefficientDatabase::add(const CoefficientSet& coefficients) {
  entries_.push_back(coefficients);
  if (!file_.empty()) write();
}

std::optional<CoefficientSet> CoefficientDatabase::find(const std::string& tool,
                                                        const std::string& material) const {
  for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry) {
    if ((tool.empty() || entry->tool == tool) && (material.empty() || entry->material == material))
      return *entry;
  }
  return std::nullopt;
}

std::string CoefficientDatabase::contents() const {
  std::set<std::string> known;
  for (const CoefficientSet& entry : entries_) known.insert(entry.tool + " / " + entry.material);
  std::string text;
  for (const std::string& name : known) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "nothing" : text;
}

// Written beside and moved over, so that a reader or a lost power finds the old file or the new one, whole.
void CoefficientDatabase::write() const {
  std::ostringstream out;
  out << "format: " << FORMAT << "\nentries:\n";
  for (const CoefficientSet& entry : entries_) {
    out << "- source: " << yamlWord(entry.source) << "\n";
    if (!entry.tool.empty()) out << "  tool: " << yamlWord(entry.tool) << "\n";
    if (!entry.material.empty()) out << "  material: " << yamlWord(entry.material) << "\n";
    char stamp[40];
    std::snprintf(stamp, sizeof stamp, "%.9f", entry.stamp);
    out << "  stamp_s: " << stamp << "\n  tests: " << entry.tests << "\n";
    if (std::isfinite(entry.friction_viscous)) {
      out << "  viscous_nm_s_per_rad: " << yamlNumber(entry.friction_viscous) << "\n";
      out << "  coulomb_nm: " << yamlNumber(entry.friction_coulomb) << "\n";
    }
    std::istringstream section(cuttingSection(entry.value, entry.std_dev));
    for (std::string line; std::getline(section, line);) out << "  " << line << "\n";
  }
  const std::string beside = file_ + ".new";
  std::ofstream stream(beside);
  stream << out.str();
  stream.close();
  std::error_code code;
  if (stream) std::filesystem::rename(beside, file_, code);
  if (!stream || code) throw Error(file_ + ": cannot be written");
}

}  // namespace smartmill::loadmeter
