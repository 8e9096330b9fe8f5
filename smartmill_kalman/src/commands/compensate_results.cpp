#include "commands/compensate_results.h"

#include <cstdio>
#include <filesystem>
#include <utility>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill::kalman {
namespace {

/// [N] from the tenth to the ninetieth percentile
double range(std::vector<double> values) {
  const double low = percentile(values, 0.1);
  return percentile(std::move(values), 0.9) - low;
}

}  // namespace

void printSensor(const char* axis, const ModalModel& sensor) {
  std::printf("sensor %s: direct %.4f", axis, sensor.direct);
  for (const Mode& mode : sensor.modes) {
    std::printf("; %.2f Hz, damping %.4f, gain %.4f", mode.frequency, mode.damping_ratio, mode.gain);
  }
  std::printf("\n");
}

std::string rangeLine(const std::string& name, const std::array<std::vector<double>, 3>& measured,
                      const std::array<std::vector<double>, 3>& compensated) {
  return formatted("%s: range 10..90 %% measured x %.1f y %.1f N, compensated x %.1f y %.1f N\n",
                   name.c_str(), range(measured[0]), range(measured[1]), range(compensated[0]),
                   range(compensated[1]));
}

void writeForce(const std::string& folder, const std::string& name, std::vector<double> time,
                std::array<std::vector<double>, 3> force) {
  Record record;
  record.time = std::move(time);
  for (std::size_t axis = 0; axis < 3; ++axis) record.add(FORCE_CHANNELS[axis]) = std::move(force[axis]);
  writeCsv(record, (std::filesystem::path(folder) / (name + ".csv")).string());
}

}  // namespace smartmill::kalman
