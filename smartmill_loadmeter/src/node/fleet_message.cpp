#include "node/fleet_message.h"

#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

smartmill_msgs::FleetPair toMsg(const FleetPair& pair) {
  smartmill_msgs::FleetPair message;
  message.tool = pair.tool;
  message.material = pair.material;
  message.records = static_cast<std::uint32_t>(pair.records);
  message.own = static_cast<std::uint32_t>(pair.own);
  message.ktc = pair.ktc;
  message.ktc_std = pair.ktc_std;
  return message;
}

smartmill_msgs::FleetMachine toMsg(const FleetMachine& machine) {
  smartmill_msgs::FleetMachine message;
  message.name = machine.member.name;
  message.here = machine.here;
  message.member = !machine.member.login.empty();
  message.records = static_cast<std::uint32_t>(machine.member.records);
  for (const std::size_t count : machine.records_by_pair)
    message.knows.push_back(static_cast<std::uint32_t>(count));
  message.silent = machine.member.silent;
  message.behind = static_cast<std::uint32_t>(machine.member.behind);
  message.effect = machine.effect;
  message.effect_std = machine.effect_std;
  message.odd = machine.outlier;
  message.meaning = machine.meaning;
  return message;
}

}  // namespace

smartmill_msgs::FleetState toMsg(const FleetPusher::State& state, const std::string& url) {
  smartmill_msgs::FleetState message;
  message.server = withoutPassword(url);
  message.reached = !state.failing;
  message.message = state.message;
  message.behind = static_cast<std::uint32_t>(state.behind);
  message.between_machines = message.between_batches = message.between_tools = message.between_cuts =
      CoefficientRecord::UNKNOWN;
  if (!state.overview) return message;
  const FleetDeviations& deviations = state.overview->deviations;
  message.between_machines = deviations.machine;
  message.between_batches = deviations.batch;
  message.between_tools = deviations.tool;
  message.between_cuts = deviations.noise;
  for (const FleetPair& pair : state.overview->pairs) message.pairs.push_back(toMsg(pair));
  for (const FleetMachine& machine : state.overview->machines) message.machines.push_back(toMsg(machine));
  return message;
}

}  // namespace smartmill::loadmeter
