#include "smartmill_core/model/cause_odds.h"

#include <fstream>

#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/model/strict_yaml.h"

namespace smartmill {
namespace {

constexpr const char* FORMAT = "smartmill-causes/1";
constexpr int MOST_MACHINES = 1000000;

}  // namespace

double CauseOdds::of(const std::string& effect) const {
  const auto found = listed.find(effect);
  return found == listed.end() ? other : found->second;
}

void writeCauseOdds(const CauseOdds& odds, const std::string& file) {
  std::ofstream out(file);
  out << "format: " << FORMAT << "\nmachines: " << odds.machines
      << "\nother_odds: " << yamlNumberExact(odds.other) << "\n";
  if (!odds.listed.empty()) out << "odds:\n";
  for (const auto& [effect, value] : odds.listed)
    out << "  " << effect << ": " << yamlNumberExact(value) << "\n";
  out.close();
  if (!out) throw Error(file + ": cannot be written");
}

CauseOdds readCauseOdds(const std::string& file) {
  const StrictYaml yaml = StrictYaml::fromFile(file);
  yaml.oneOf("format", {FORMAT});
  CauseOdds odds;
  odds.machines = static_cast<std::size_t>(yaml.integer("machines", 0, MOST_MACHINES));
  odds.other = yaml.number("other_odds", Range::positive());
  if (const auto listed = yaml.optionalMap("odds")) {
    for (const std::string& effect : listed->keys()) {
      if (!findEffect(effect)) listed->fail(effect, "is not an effect of the catalogue");
      odds.listed[effect] = listed->number(effect, Range::positive());
    }
    listed->finish();
  }
  yaml.finish();
  return odds;
}

}  // namespace smartmill
