#include "node/fleet_overview.h"

#include <algorithm>
#include <map>
#include <utility>

namespace smartmill::loadmeter {
namespace {

constexpr double OUTLIER_PROBABILITY = 0.5;  // [1] smallest probability of an outlier with a stated cause
constexpr double UNKNOWN = CoefficientRecord::UNKNOWN;

using Pair = std::pair<std::string, std::string>;  // tool, material

/// Machines by name, including those without a login.
std::map<std::string, FleetMachine> machinesOf(const std::vector<FleetMember>& members,
                                               std::vector<CoefficientRecord>& records,
                                               const std::string& login) {
  std::map<std::string, FleetMachine> machines;
  std::map<std::string, std::string> name_of;
  for (const FleetMember& member : members) {
    FleetMachine& machine = machines[member.name];
    machine.member = member;
    machine.here = member.login == login;
    name_of[member.login] = member.name;
  }
  for (CoefficientRecord& record : records) {
    if (record.machine.empty()) record.machine = "(no name)";
    const auto named = name_of.find(record.machine);
    if (!machines.count(record.machine) && named != name_of.end()) record.machine = named->second;
    machines[record.machine].member.name = record.machine;
  }
  return machines;
}

std::vector<FleetPair> pairsOf(const std::vector<CoefficientRecord>& records, const std::string& here) {
  std::map<Pair, FleetPair> found;
  for (const CoefficientRecord& record : records) {
    FleetPair& pair = found[{record.set.tool, record.set.material}];
    pair.tool = record.set.tool;
    pair.material = record.set.material;
    ++pair.records;
    pair.own += record.machine == here;
  }
  std::vector<FleetPair> pairs;
  for (auto& [key, pair] : found) pairs.push_back(std::move(pair));
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const FleetPair& a, const FleetPair& b) { return a.records > b.records; });
  return pairs;
}

/// Adds the results of the hierarchical model; NaN without a Ktc.
void addModel(const std::vector<CoefficientRecord>& records, const std::string& here,
              std::map<std::string, FleetMachine>& machines, FleetOverview& overview) {
  overview.deviations = {UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN};
  const auto observations = observationsOf(records, &CuttingCoefficients::ktc);
  if (observations.empty()) return;
  const FleetModel model(observations);
  overview.deviations = model.deviations();
  for (const MachineEffect& effect : model.machines()) {
    FleetMachine& machine = machines.at(effect.machine);
    machine.effect = effect.effect;
    machine.effect_std = effect.std_dev;
    machine.outlier = effect.outlier;
    if (effect.outlier > OUTLIER_PROBABILITY) machine.meaning = effect.meaning();
  }
  for (FleetPair& pair : overview.pairs) {
    const auto next = model.predict(here, pair.material, pair.tool);
    if (!next) continue;
    pair.ktc = next->value;
    pair.ktc_std = next->std_dev;
  }
}

}  // namespace

std::string loginOf(const std::string& url) {
  const std::size_t begin = url.find("://");
  if (begin == std::string::npos) return "";
  const std::size_t end = url.find_first_of("/?", begin + 3), at = url.substr(0, end).rfind('@');
  if (at != std::string::npos) return url.substr(begin + 3, url.find_first_of(":@", begin + 3) - begin - 3);
  const std::size_t word =
      url.find_first_of('?') == std::string::npos ? std::string::npos : url.find("user=");
  return word == std::string::npos ? "" : url.substr(word + 5, url.find('&', word) - word - 5);
}

FleetOverview fleetOverview(const std::vector<FleetMember>& members,
                            const std::vector<CoefficientRecord>& all, const std::string& login) {
  std::vector<CoefficientRecord> records = all;
  std::map<std::string, FleetMachine> machines = machinesOf(members, records, login);
  const auto self =
      std::find_if(machines.begin(), machines.end(), [](const auto& m) { return m.second.here; });
  const std::string here = self == machines.end() ? "" : self->first;
  FleetOverview overview;
  overview.pairs = pairsOf(records, here);
  std::map<Pair, std::size_t> index;
  for (std::size_t k = 0; k < overview.pairs.size(); ++k)
    index[{overview.pairs[k].tool, overview.pairs[k].material}] = k;
  for (auto& [name, machine] : machines) machine.records_by_pair.assign(overview.pairs.size(), 0);
  for (const CoefficientRecord& record : records)
    ++machines.at(record.machine).records_by_pair[index.at({record.set.tool, record.set.material})];
  addModel(records, here, machines, overview);
  for (auto& [name, machine] : machines) overview.machines.push_back(std::move(machine));
  return overview;
}

bool updateMembers(const std::vector<FleetMember>& members, FleetOverview& overview) {
  for (const FleetMember& member : members) {
    const auto found = std::find_if(overview.machines.begin(), overview.machines.end(), [&](const auto& m) {
      return m.member.name == member.name && m.member.login == member.login;
    });
    if (found == overview.machines.end()) return false;
    found->member = member;
  }
  return true;
}

}  // namespace smartmill::loadmeter
