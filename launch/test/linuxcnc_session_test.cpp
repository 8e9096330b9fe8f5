// A short session with a real LinuxCNC, headless and in its own namespaces, that moves the axes of the twin.
// Skipped if LinuxCNC is not installed (./setup --with-linuxcnc) or the namespaces cannot be created.

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "launched.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace {

using smartmill::TemporaryFolder;
using namespace smartmill::testing;

/// Lines of a file with one of these words: what ended the session, before the whole log.
std::string linesWith(const std::string& file, const std::vector<std::string>& words) {
  std::istringstream in(contentOf(file));
  std::string text;
  for (std::string line; std::getline(in, line);) {
    for (const std::string& word : words) {
      if (line.find(word) == std::string::npos) continue;
      text += line + "\n";
      break;
    }
  }
  return text;
}

TEST(LinuxCncMachine, AShortSessionFindsTheTwinsCoefficients) {
  if (::access("/usr/bin/linuxcnc", X_OK) != 0) GTEST_SKIP() << "LinuxCNC is not installed";
  if (::geteuid() != 0) GTEST_SKIP() << "the namespaces of LinuxCNC require root";
  const TemporaryFolder folder;
  setenv("ROS_HOSTNAME", "localhost", 1);
  setenv("ROS_HOME", folder.file("ros_home").c_str(), 1);
  const std::string machine = "/dev/shm/smartmill_session_" + std::to_string(::getpid());
  const std::string summary = folder.file("session.json"), log = folder.file("log.txt");
  std::string summary_text;
  // LinuxCNC may end by itself on a computer that starves its real-time thread. Whatever else ends the
  // session fails.
  for (int attempt = 1; attempt <= 2; ++attempt) {
    run("roslaunch -p " + freePort() + " " SESSION " folder:=" + machine + " summary:=" + summary, log);
    const std::string ended = contentOf(machine + "/linuxcnc.log");
    std::filesystem::remove_all(machine);
    summary_text = contentOf(summary);
    if (summary_text.find("\"completed\": true") != std::string::npos) break;
    const bool by_itself = contentOf(log).find("linuxcnc_machine: LinuxCNC has ended") != std::string::npos;
    ASSERT_TRUE(by_itself && attempt == 1)
        << linesWith(log, {"died", "ended", "FAIL", "ERROR"}) << contentOf(log);
    std::cout << "LinuxCNC has ended by itself, the session is repeated:\n" << ended << "\n";
  }
  std::smatch ktc;
  ASSERT_TRUE(std::regex_search(summary_text, ktc, std::regex("Ktc ([0-9.]+)"))) << summary_text;
  // N/mm2; three percent as for a whole session (docs/pipeline.md).
  const double truth = 1e-6 * smartmill::readMachineModel("models/mill_twin.yaml").cutting->ktc;
  EXPECT_NEAR(std::stod(ktc[1]), truth, 0.03 * truth);
}

}  // namespace
