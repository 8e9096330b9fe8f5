#include "smartmill_kalman/commands.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/filter/low_pass.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"

namespace {

using namespace smartmill;
using kalman::LengthDependence;
using kalman::SpindleSensorCalibration;

struct Request {
  std::string table, base, out, calibration;
  double low_pass = 0.0;
};

void printLengthDependence(const char* what, const LengthDependence& found, const LengthDependence& before,
                           double length) {
  std::printf("%-32s %9.4g L + %9.4g   std %.2g, %.2g%s   at %.0f mm %8.3f   before %8.3f\n", what,
              found.slope * units::MM, found.offset, found.slope_std * units::MM, found.offset_std,
              found.reciprocal ? " of its reciprocal" : "", length / units::MM, found.at(length),
              before.at(length));
}

void calibrate(const Request& request) {
  const SpindleSensorCalibration base =
      request.base.empty() ? SpindleSensorCalibration::table3() : kalman::readSpindleSensor(request.base);
  const kalman::StaticMeasurements measurements = kalman::readStaticMeasurements(request.table);
  const kalman::StaticCalibration found = kalman::calibrateStatic(measurements, base);
  const SpindleSensorCalibration& c = found.calibration;
  const double length = found.lengths.front().length;
  LengthDependence none;
  none.offset = std::nan("");
  std::printf(
      "constants over the length L [mm] of tool and holder (applied over measured force), valid for %.0f .. "
      "%.0f mm\n",
      c.lengths[0] / units::MM, c.lengths[1] / units::MM);
  printLengthDependence("x", c.x, base.x, length);
  printLengthDependence("y", c.y, base.y, length);
  printLengthDependence("z", c.z, base.z, length);
  const auto cross = [&](const char* what, const std::optional<LengthDependence>& line,
                         const std::optional<LengthDependence>& before) {
    if (line) {
      printLengthDependence(what, *line, before.value_or(none), length);
    } else {
      std::printf("%-32s none beyond its uncertainty\n", what);
    }
  };
  cross("cross-talk in x, caused by y", c.yx, base.yx);
  cross("cross-talk in z, caused by y", c.yz, base.yz);
  cross("cross-talk in z, caused by x", c.xz, base.xz);
  for (const kalman::ConstantsAtLength& l : found.lengths) {
    const auto left = [&l](int row, int column) { return 100.0 * l.share[row][column] / l.share[row][row]; };
    std::printf(
        "%.1f mm: drift up to %.2f N/min removed, residual %.3f N; outside the model: x in y %.2f %%, z in "
        "x %.2f %%, z in y %.2f %%\n",
        l.length / units::MM, 60.0 * l.drift, l.residual, left(1, 0), left(0, 2), left(1, 2));
    std::printf("%.1f mm: a sensor is unloaded or overloaded beyond %.0f N along x, %.0f N along y\n",
                l.length / units::MM, kalman::lateralLimit(c, l.length, 0),
                kalman::lateralLimit(c, l.length, 1));
  }
  kalman::writeSpindleSensor(c, request.out);
  std::printf("written to %s\n", request.out.c_str());
}

void verify(const Request& request) {
  const auto error = kalman::verifyStatic(kalman::readStaticMeasurements(request.table),
                                          kalman::readSpindleSensor(request.calibration));
  std::printf(
      "largest difference from the reference over its largest force: x %.2f y %.2f z %.2f %% (limit 5)\n",
      100.0 * error[0], 100.0 * error[1], 100.0 * error[2]);
  if (*std::max_element(error.begin(), error.end()) > kalman::LARGEST_STATIC_ERROR)
    throw Error(request.table + ": the calibration is off by more than 5 %");
}

void apply(const Request& request) {
  const SpindleSensorCalibration c = kalman::readSpindleSensor(request.calibration);
  const kalman::StaticMeasurements record = kalman::readStaticMeasurements(request.table);
  kalman::checkLengths(record, c);
  std::array<std::vector<double>, 3> force;
  std::size_t unloaded = 0;
  for (std::size_t i = 0; i < record.size(); ++i) {
    const auto f = kalman::staticForce(c, record.length[i], kalman::pairMeans(record.sensors[i]));
    bool good = true;
    for (std::size_t k = 0; k < 6; ++k) {
      const double left = c.preload[k] + record.sensors[i][k];
      good = good && left > c.least_compression && left <= c.range_limit;
    }
    unloaded += !good;
    for (std::size_t axis = 0; axis < 3; ++axis) force[axis].push_back(good ? f[axis] : std::nan(""));
  }
  if (request.low_pass > 0.0) {
    if (unloaded > 0) throw Error(request.table + ": invalid samples, which cannot be filtered");
    if (record.size() < 3) throw Error(request.table + ": too short for a low-pass");
    const double rate = static_cast<double>(record.size() - 1) / (record.time.back() - record.time.front());
    for (auto& axis : force) axis = kalman::zeroPhaseLowPass(axis, request.low_pass, rate);
  }
  std::ofstream out(request.out);
  out << "time[s],fx[N],fy[N],fz[N]\n";
  for (std::size_t i = 0; i < record.size(); ++i) {
    out << formatted("%.9g,%.6g,%.6g,%.6g\n", record.time[i], force[0][i], force[1][i], force[2][i]);
  }
  out.close();
  if (!out) throw Error(request.out + ": cannot write");
  std::printf("%zu samples written to %s, %zu of them invalid\n", record.size(), request.out.c_str(),
              unloaded);
}

}  // namespace

namespace smartmill::kalman {

Command spindleSensorCommand() {
  Command command("spindle-sensor", "calibrates, verifies and applies a spindle-integrated force sensor");
  command.description =
      "Spindle-integrated force sensor of six preloaded quartz rings.\nTables: test, time[s], length[mm], "
      "load_x[N], load_y[N], load_z[N], x1[N], x2[N], y1[N], y2[N], z1[N], z2[N]; one row per measurement.";
  command.examples = {
      {"calibrate weights.csv -o sensor.yaml", "constants over tool length from hung weights"},
      {"verify sensor.yaml reference.csv", "fails where a force is off by more than 5 %"},
      {"apply sensor.yaml record.csv -o forces.csv", "forces of a record"}};
  command.files = {{"CALIBRATION", "YAML file that `calibrate` writes"}};
  command.exits = {{1, "error, or `verify` found more than 5 %; reported in one line on standard error"}};
  command.declare = [](CommandLine& line) -> std::function<int()> {
    Subcommands<Request> commands(line);
    Request& request = commands.options();
    const CommandOptions c =
        commands.add("calibrate", "constants over tool length from weights hung on a tool", calibrate);
    c.option("TABLE", request.table, "measurements; those of one test drift together").required();
    c.option("-o,--out", request.out, "calibration file").required();
    c.option("--base", request.base,
             "calibration file with preload, limits and low-pass (default: Burzoni's sensor)");
    const CommandOptions v =
        commands.add("verify", "compares with reference forces; fails beyond 5 %", verify);
    v.option("CALIBRATION", request.calibration, "calibration file").required();
    v.option("TABLE", request.table, "measurements with reference forces as loads").required();
    const CommandOptions a = commands.add("apply", "forces of a record", apply);
    a.option("CALIBRATION", request.calibration, "calibration file").required();
    a.option("TABLE", request.table, "record, evenly sampled").required();
    a.option("-o,--out", request.out, "CSV of the forces").required();
    a.option("--low-pass-hz", request.low_pass, "zero-phase low-pass; 0: none").showDefault();
    return commands.body();
  };
  return command;
}

}  // namespace smartmill::kalman
