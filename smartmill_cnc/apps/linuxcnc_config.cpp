// rosrun smartmill_cnc linuxcnc_config MODEL -o FOLDER: configuration of a LinuxCNC without hardware.

#include <filesystem>
#include <fstream>
#include <string>

#include "smartmill_cnc/linuxcnc/configuration.h"
#include "smartmill_core/program.h"

int main(int argc, char** argv) {
  using namespace smartmill;
  std::string model, folder;
  CommandLine line{
      "Writes a configuration of LinuxCNC for linuxcnc_machine (docs/linuxcnc.md): ideal axes and spindle\n"
      "with the travel, speeds and accelerations of a machine model."};
  line.option("model", model, "machine model file with the sections axes and spindle").required();
  line.option("-o,--out", folder, "output folder, created if missing").required();
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
