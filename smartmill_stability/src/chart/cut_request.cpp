#include "smartmill_stability/chart/cut_request.h"

#include <cmath>
#include <utility>

#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/model_system.h"

namespace smartmill::stability {

void CutRequest::addCutTo(CommandLine& line) {
  line.option("MODEL", model, "machine model file with sections tool, cutting and tool_tip").required();
  line.option("--entry-deg", entry_deg, "immersion angle at which a tooth enters [deg]").required();
  line.option("--exit-deg", exit_deg, "immersion angle at which a tooth leaves [deg]").required();
  line.option("--position-mm", position_mm,
              "position along a vibrating workpiece [mm] (section workpiece.modes of the model)");
}

void CutRequest::addTo(CommandLine& line, const std::string& form) {
  addCutTo(line);
  line.option("--speeds", speeds, form + " [rpm]").required();
}

void CutRequest::addOutTo(CommandLine& line, const std::string& what) {
  line.option("-o,--out", out, "CSV file; " + what + " of the same name with .png is drawn").required();
}

MachineModel CutRequest::machine() const {
  MachineModel machine = readMachineModel(model);
  return std::isfinite(position_mm) ? atPosition(std::move(machine), position_mm * units::MM) : machine;
}

RegenerativeSystem CutRequest::system(const MachineModel& machine) const {
  return systemOf(machine, entry_deg, exit_deg);
}

std::vector<double> CutRequest::speedRange() const {
  std::vector<double> range = rangeOf("--speeds", speeds);
  for (double& speed : range) speed = units::radPerSecFromRpm(speed);
  return range;
}

}  // namespace smartmill::stability
