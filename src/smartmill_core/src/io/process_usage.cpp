#include "smartmill_core/io/process_usage.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

namespace smartmill {
namespace {

// Fields of /proc/PID/stat after the name, which may contain blanks and brackets.
constexpr std::size_t USER_TIME = 11, SYSTEM_TIME = 12, THREADS = 17, RESIDENT = 21;

}  // namespace

ProcessUsage processUsage(int process) {
  const std::string folder = "/proc/" + (process == 0 ? "self" : std::to_string(process));
  std::ifstream file(folder + "/stat");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::size_t name_end = text.rfind(')');
  if (name_end == std::string::npos) return {};
  std::istringstream words(text.substr(name_end + 1));
  const std::vector<std::string> fields{std::istream_iterator<std::string>(words), {}};
  if (fields.size() <= RESIDENT) return {};

  ProcessUsage usage;
  usage.cpu_time = (std::stod(fields[USER_TIME]) + std::stod(fields[SYSTEM_TIME])) /
                   static_cast<double>(::sysconf(_SC_CLK_TCK));
  usage.memory = std::stod(fields[RESIDENT]) * static_cast<double>(::sysconf(_SC_PAGESIZE));
  usage.threads = static_cast<std::uint32_t>(std::stoul(fields[THREADS]));
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder + "/fd", error), end; !error && entry != end;
       entry.increment(error))
    ++usage.descriptors;
  return usage;
}

}  // namespace smartmill
