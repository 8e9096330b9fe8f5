#include <cstdio>
#include <filesystem>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/io/uff.h"
#include "smartmill_core/modal/frf_files.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/picture.h"
#include "smartmill_stability/commands.h"
#include "smartmill_stability/coupling/tool_table.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::stability;  // NOLINT

struct Request {
  std::string table, tool, out, model;
  double contact_scatter = AssemblyOptions{}.contact_scatter;
  bool uff = false;
};

void writeUniversal(const FrequencyResponse& frf, const std::string& name, int direction,
                    const std::string& file) {
  UffFunction function;
  function.type = uff::FREQUENCY_RESPONSE;
  function.name = name;
  function.response_node = function.reference_node = 1;
  function.response_direction = function.reference_direction = direction;
  function.numerator = uff::DISPLACEMENT;
  function.denominator = uff::EXCITATION_FORCE;
  function.unit = "m/N";
  function.abscissa = frf.frequency;
  function.value = frf.value;
  writeUff({function}, file, false);
}

void draw(const std::string& file) {
  drawPicture(
      file,
      "set xlabel 'Frequency [Hz]'\nset ylabel 'Receptance of the tip [m/N]'\nset logscale y\nset format y "
      "'%.0e'\nplot %FILE skip 1 using 1:(sqrt($2**2+$3**2)+2*$5):(abs(sqrt($2**2+$3**2)-2*$5)) with "
      "filledcurves lc 'light-gray' title 'two standard deviations', %FILE skip 1 using "
      "1:(sqrt($2**2+$3**2)) with lines lw 2 title 'predicted'");
}

/// Predicts one direction and writes its files.
ModalModel predict(const Request& request, const ToolTable& table, const TableTool& entry, bool along_y) {
  AssemblyOptions options;
  options.contact_scatter = request.contact_scatter;
  const TableAssembly machine = assemblyOf(table, along_y, options);
  const ContactEstimate contact = machine.contactOf(request.tool, options.contact_scatter);
  const TipPrediction found = machine.assembly.predict(entry.tool, contact);
  const ModalModel modes = modesOf(found);
  const std::string axis = along_y ? "y" : "x", stem = request.out + "/frf_" + axis;
  writeFrfCsv(found.tip, stem + ".csv");
  draw(stem + ".csv");
  if (request.uff) writeUniversal(found.tip, request.tool + " " + axis, along_y ? 2 : 1, stem + ".uff");
  writeModesYaml(estimateOf(modes), "m/N", {stem + ".csv"}, request.out + "/modes_" + axis + ".yaml");
  std::printf(
      "%s: largest peak %.1f +- %.1f Hz, %.4f +- %.4f um/N, damping ratio %.2f %%; contact %.3g N/m, %.3g "
      "N m/rad; tapped tools: %zu\n",
      axis.c_str(), found.peak.frequency, found.frequency_std, found.peak.flexibility / units::UM,
      found.flexibility_std / units::UM, 100.0 * found.peak.damping, contact.value(translation),
      contact.value(rotation), machine.tapped.size());
  return modes;
}

void run(const Request& request) {
  const ToolTable table = readToolTable(request.table);
  const TableTool& entry = table.tool(request.tool);
  std::filesystem::create_directories(request.out);
  const ModalModel x = predict(request, table, entry, false);
  const ModalModel y = predict(request, table, entry, true);
  if (request.model.empty()) return;
  MachineModel model = readMachineModel(request.model);
  model.tool = entry.geometry;
  model.stickout = entry.tool.stickout;
  model.tool_tip.x = x;
  model.tool_tip.y = y;
  writeMachineModel(model, request.out + "/model.yaml");
}

}  // namespace

namespace smartmill::stability {

Command toolFrfCommand() {
  Command command("tool-frf", "predicts the tip FRF of a tool that was not tapped");
  command.description =
      "Tip FRF of a tool from its dimensions and the receptances of the spindle, which follow from taps on a "
      "gauge "
      "(receptance coupling). Tapped tools of the table determine the contact of shank and holder.";
  command.examples = {{"tools.yaml --tool em12_60 -o tip/", "FRFs, modes and pictures in x and y"},
                      {"tools.yaml --tool em12_60 --model mill.yaml -o tip/",
                       "in addition tip/model.yaml, which `lobes` reads"}};
  command.files = {
      {"TABLE",
       "YAML smartmill-tools/1: gauge with its FRF files (CSV as written by `frf`, or UFF), holder, tools"},
      {"OUT/frf_x.csv", "frequency_hz,real,imag,coherence,std [m/N]; a picture of the same name with .png"},
      {"OUT/modes_x.yaml", "modes with standard deviations"},
      {"OUT/model.yaml", "the machine model with tool and modes"}};
  command.setBody(run, [](CommandLine& line, Request& request) {
    line.option("TABLE", request.table, "tool table").required();
    line.option("--tool", request.tool, "name of the tool").required();
    line.option("-o,--out", request.out, "folder of the results").required();
    line.option("--model", request.model, "machine model file: writes OUT/model.yaml with this tool");
    line.option("--contact-scatter", request.contact_scatter,
                "relative standard deviation of the contact from tool to tool")
        .showDefault();
    line.flag("--uff", request.uff, "FRFs as universal files too");
  });
  return command;
}

}  // namespace smartmill::stability
