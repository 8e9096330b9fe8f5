#include "smartmill_cli/commands.h"

#include "smartmill_cli/completion.h"
#include "smartmill_cli/manual.h"
#include "smartmill_cnc/commands.h"
#include "smartmill_core/version.h"
#include "smartmill_daq/commands.h"
#include "smartmill_discrepancy/commands.h"
#include "smartmill_exchange/commands.h"
#include "smartmill_hammer/commands.h"
#include "smartmill_kalman/commands.h"
#include "smartmill_loadmeter/commands.h"
#include "smartmill_program/commands.h"
#include "smartmill_recording/commands.h"
#include "smartmill_sim/commands.h"
#include "smartmill_stability/commands.h"

namespace smartmill {

CommandProgram smartmillProgram() {
  CommandProgram program;
  program.name = "smartmill";
  program.summary =
      "Measured and simulated milling: dynamics, forces, stability, and what a machine model lacks.";
  program.version = version();
  program.topics = {
      {"Instruments", {daq::daqCommand(), daq::sensitivityCommand(), daq::alignCommand()}},
      {"Records",
       {discrepancy::campaignCommand(), recording::convertCommand(), recording::exportCommand(),
        recording::accountCommand(), exchange::itemsCommand()}},
      {"Machine model and twin",
       {discrepancy::explainCommand(), discrepancy::gapCommand(), sim::simulateCommand(),
        sim::hideCommand()}},
      {"Dynamics of tool, spindle and force sensor",
       {hammer::frfCommand(), stability::toolFrfCommand(), kalman::cuttingFrfCommand(),
        hammer::healthCommand(), kalman::sensorReportCommand(), kalman::spindleSensorCommand()}},
      {"Cutting forces",
       {kalman::compensateCommand(), loadmeter::coefficientsCommand(), loadmeter::forceLawCommand(),
        loadmeter::planCutsCommand(), loadmeter::calibrateCommand(), loadmeter::axisDriveCommand(),
        loadmeter::databaseCommand()}},
      {"Stability",
       {stability::lobesCommand(), stability::chartCommand(), stability::chatterProbabilityCommand(),
        stability::processDampingCommand(), stability::detectCommand(), stability::nextSpeedCommand(),
        stability::lobesFromCutsCommand()}},
      {"NC programs", {smartmill::program::programCommand()}},
      {"Controller", {sim::controllerCommand(), cnc::captureCommand(), cnc::fetchProgramCommand()}},
  };
  const CommandProgram shown = program;
  program.hidden = {completionCommand(shown), manualCommand(shown)};
  return program;
}

}  // namespace smartmill
