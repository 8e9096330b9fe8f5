#include "session/child.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>

#include "smartmill_core/error.h"

namespace smartmill::session {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds POLL(20);
constexpr std::chrono::seconds GRACE(5);  // for the cleanup of a program after SIGINT
constexpr int NOT_STARTED = 127;
constexpr int USAGE = 2;  // exit status of a command line that a subcommand does not accept

[[noreturn]] void executeCommand(const std::vector<std::string>& command, int log) {
  // Its own process group: its children get the signals too, and it gets no Ctrl-C from the terminal.
  setpgid(0, 0);
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  signal(SIGINT, SIG_DFL);
  signal(SIGTERM, SIG_DFL);
  std::vector<char*> words;
  for (const std::string& word : command) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  execvp(words[0], words.data());
  _exit(NOT_STARTED);
}

}  // namespace

int runChild(const std::vector<std::string>& command, const std::string& log,
             const std::function<bool()>& stopped) {
  const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (out < 0) throw Error(log + ": " + std::strerror(errno));
  const pid_t child = fork();
  if (child == 0) executeCommand(command, out);
  close(out);
  if (child < 0) throw Error(command.front() + ": " + std::strerror(errno));
  setpgid(child, child);
  bool interrupted = false;
  Clock::time_point interrupt_time;
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (!interrupted && stopped()) {
      interrupted = true;
      interrupt_time = Clock::now();
      kill(-child, SIGINT);
    }
    if (interrupted && Clock::now() > interrupt_time + GRACE) kill(-child, SIGKILL);
    std::this_thread::sleep_for(POLL);
  }
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  if (code == NOT_STARTED) {
    throw Error("program '" + command.front() +
                "' not found on PATH; source devel/setup.bash or install the package smartmill");
  }
  return code;
}

int runTool(const Tool& tool, const std::vector<std::string>& arguments, const std::string& log,
            const std::function<bool()>& stopped) {
  std::vector<std::string> command{TOOL_PROGRAM, tool.subcommand};
  command.insert(command.end(), arguments.begin(), arguments.end());
  const std::string name = command[0] + " " + command[1];
  int code = 0;
  try {
    code = runChild(command, log, stopped);
  } catch (const Error& error) {
    throw Error(name + ", needed for " + tool.purpose + ": " + error.what());
  }
  if (code == USAGE)
    throw Error(name + ", needed for " + tool.purpose + ": command line refused, see " + log);
  return code;
}

}  // namespace smartmill::session
