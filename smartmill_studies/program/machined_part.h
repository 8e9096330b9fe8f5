#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_program/live/live_program.h"
#include "smartmill_sim/world/world.h"

namespace smartmill {

/// A program, simulated in the stock of a model's workpiece, as program_node prepares it.
/// @param tools model files, see program::ToolModels
std::shared_ptr<const program::LiveProgram> preparedPart(const std::string& text,
                                                         const std::vector<std::string>& tools,
                                                         const MachineModel& model);

/// What the machine and its bridge give while a part is machined, in the order of time. Unset functions
/// receive nothing.
struct PartStreams {
  std::function<void(const CncState&)> state = [](const CncState&) {};
  std::function<void(const LoadSample&)> load = [](const LoadSample&) {};
  std::function<void(const CuttingCondition&)> condition = [](const CuttingCondition&) {};
  std::function<void(const sim::World::Block&)> sensors = [](const sim::World::Block&) {};
};

/// How a program is run.
struct PartSetUp {
  bool from_memory = false;              ///< by the operator, not sent through the bridge
  std::map<int, MachineModel> magazine;  ///< true tools, see sim::WorldOptions
};

struct MachinedPart {
  std::size_t cuts = 0, air = 0, lost = 0;  ///< conditions stated, losses of the path
  double time = 0.0;                        ///< [s] of the program
};

/// Machines a part from its first block to its end: simulated machine and Fanuc control, bridge over FOCAS,
/// follower of the program. Stamps of the sensors count from the start of the machine, as those of the
/// states.
/// @param machine that is simulated @param nominal its stated model @throws Error when the control refuses.
MachinedPart machinePart(const MachineModel& machine, const MachineModel& nominal, const std::string& text,
                         const std::shared_ptr<const program::LiveProgram>& program, std::uint64_t seed,
                         const PartStreams& streams, const PartSetUp& set_up = {});

}  // namespace smartmill
