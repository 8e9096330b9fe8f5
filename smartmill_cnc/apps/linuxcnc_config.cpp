// rosrun smartmill_cnc linuxcnc_config MODEL -o FOLDER: a configuration of LinuxCNC for a machine without
// hardware.

#include <filesystem>
#include <fstream>
#include <string>

#include "smartmill_cnc/linuxcnc/configuration.h"
#include "smartmill_core/program.h"

int main(int argc, char** argv) {
  using namespace smartmill;
  std::string model, folder;
  CommandLine line{
      "Writes a configuration of LinuxCNC: ideal axes and spindle with the travel, speeds and accelerations "
      "of a "
      "machine\nmodel, for linuxcnc_machine to start (docs/linuxcnc.md)."};
  line.option("model", model, "machine model file: its sections axes and spindle").required();
  line.option("-o,--out", folder, "folder to write to; made where it is missing").required();
  return runProgram(line, argc, argv, [&] {
    folder = std::filesystem::absolute(folder).string();
    std::filesystem::create_directories(folder);
    for (const auto& [name, text] : cnc::linuxcnc::configurationOf(readMachineModel(model), folder)) {
      std::ofstream file(folder + "/" + name);
      if (!(file << text).flush()) {
        throw Error(folder + "/" + name + ": cannot be written");
      }
    }
  });
}
