#include "smartmill_cnc/motion/arming.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"

namespace smartmill::cnc {
namespace {

namespace fs = std::filesystem;

constexpr int MODE = 0640;  // readable by the group, for those who review it

int openToAppend(const std::string& file) {
  return ::open(file.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, MODE);
}

Error failure(const std::string& file, int number) {
  return Error(file + ": cannot be written: " + std::strerror(number));
}

std::string named(const std::string& client) {
  return client.empty() ? "an unnamed client" : client;
}

}  // namespace

std::string armRefusal(const std::optional<ArmHolder>& holder, const std::string& client) {
  if (!holder || holder->client == client) return {};
  return "motion is armed by " + named(holder->client) + " since " + utcText(holder->since) +
         "; it has to be disarmed first";
}

std::string motionRefusal(const std::optional<ArmHolder>& holder, const std::string& client,
                          const std::vector<std::string>& helpers) {
  if (!holder || holder->client == client) return {};
  if (std::find(helpers.begin(), helpers.end(), client) != helpers.end()) return {};
  return "motion is armed by " + named(holder->client) + " since " + utcText(holder->since) + ", not by " +
         named(client);
}

std::string clientOfGoal(const std::string& goal_id) {
  const std::size_t hyphen = goal_id.find('-');
  return hyphen == std::string::npos || goal_id[0] != '/' ? std::string() : goal_id.substr(0, hyphen);
}

std::string utcText(double time) {
  const auto seconds = static_cast<std::time_t>(std::floor(time));
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  return formatted("%04d-%02d-%02d %02d:%02d:%02d UTC", parts.tm_year + 1900, parts.tm_mon + 1, parts.tm_mday,
                   parts.tm_hour, parts.tm_min, parts.tm_sec);
}

MotionLog::MotionLog(std::string file) : file_(std::move(file)) {
  if (file_.empty()) return;
  std::error_code ignored;  // the file reports the failure
  fs::create_directories(fs::absolute(file_).parent_path(), ignored);
  const int descriptor = openToAppend(file_);
  if (descriptor < 0) throw failure(file_, errno);
  ::close(descriptor);
}

void MotionLog::write(double time, const std::string& client, const std::string& what) {
  constexpr std::size_t MOST_KEPT = 1u << 20;  // [bytes]
  if (file_.empty()) return;
  std::string line = utcText(time) + "  " + named(client) + "  " + what;
  std::replace_if(
      line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  line += '\n';
  const std::lock_guard<std::mutex> lock(mutex_);
  if (kept_.size() + line.size() > MOST_KEPT) throw failure(file_, ENOSPC);
  kept_ += line;
  writeAll();
}

void MotionLog::writeKept() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!kept_.empty()) writeAll();
}

// Opened each time, so that the file can be rotated.
void MotionLog::writeAll() {
  const int descriptor = openToAppend(file_);
  if (descriptor < 0) throw failure(file_, errno);
  const ssize_t written = ::write(descriptor, kept_.data(), kept_.size());
  const int number = errno;
  ::close(descriptor);
  if (written > 0) kept_.erase(0, static_cast<std::size_t>(written));
  if (!kept_.empty()) throw failure(file_, written < 0 ? number : ENOSPC);
}

}  // namespace smartmill::cnc
