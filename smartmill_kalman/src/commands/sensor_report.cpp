#include "smartmill_kalman/commands.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/sensor/state_space_checks.h"
#include "smartmill_kalman/sensor/tap_file.h"
#include "smartmill_kalman/sensor/transfer_matrix.h"

namespace {

using namespace smartmill;
using kalman::MatrixTap;
using kalman::TransferMatrix;

constexpr double DETERMINED = 0.1;  // [1]
constexpr auto& CHANNELS = PLATE_CHANNELS;

using Taps = kalman::TapRecords;

Taps fromCampaign(const std::string& path) {
  const Campaign campaign = readCampaign(path);
  Taps found;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::tap) continue;
    const Record record = readRecord(campaign, test);
    MatrixTap tap;
    tap.direction[*axisIndex(test.direction)] = 1.0;
    tap.hammer = record.column("hammer");
    for (std::size_t c = 0; c < 3; ++c) tap.channels.push_back(record.column(CHANNELS[c]));
    if (found.rate != 0.0 && found.rate != test.sample_rate)
      throw Error(record.file + ": sample rate differs from the other taps");
    found.rate = test.sample_rate;
    found.taps.push_back(std::move(tap));
  }
  return found;
}

void writeMatrix(const TransferMatrix& matrix, const std::string& file) {
  std::ofstream out(file);
  out << "frequency[Hz],condition[1]";
  for (std::size_t i = 0; i < matrix.channels; ++i) {
    for (std::size_t j = 0; j < matrix.channels; ++j) {
      const std::string name = std::string(CHANNELS[i]) + "_" + CHANNELS[j];
      for (const char* what : {"re", "im", "std"}) out << ",measured_" << name << "_" << what;
      for (const char* what : {"re", "im", "std"}) out << ",applied_" << name << "_" << what;
    }
  }
  out << "\n";
  for (std::size_t l = 0; l < matrix.frequency.size(); ++l) {
    out << formatted("%.6g,%.6g", matrix.frequency[l], matrix.condition[l]);
    for (Eigen::Index i = 0; i < matrix.forward[l].rows(); ++i) {
      for (Eigen::Index j = 0; j < matrix.forward[l].cols(); ++j) {
        const auto g = matrix.forward[l](i, j), h = matrix.inverse[l](i, j);
        out << formatted(",%.6g,%.6g,%.4g,%.6g,%.6g,%.4g", g.real(), g.imag(), matrix.forward_std[l](i, j),
                         h.real(), h.imag(), matrix.inverse_std[l](i, j));
      }
    }
    out << "\n";
  }
  out.close();
  if (!out) throw Error(file + ": cannot write");
}

/// Frequency up to which every element is known to a tenth of the static gain [Hz].
double determinedUpTo(const TransferMatrix& matrix, double low) {
  double determined = low;
  for (std::size_t l = 0; l < matrix.frequency.size(); ++l) {
    if (matrix.frequency[l] <= low) continue;
    if (matrix.forward_std[l].topLeftCorner(3, 3).maxCoeff() > DETERMINED) break;
    determined = matrix.frequency[l];
  }
  return determined;
}

void report(const TransferMatrix& matrix, double low, double high, int max_modes) {
  std::printf("%d taps, %zu channels, lines %.2f Hz apart", matrix.hits, matrix.channels,
              matrix.frequency[1] - matrix.frequency[0]);
  if (matrix.channels == 6) std::printf(", moments over a lever of %.1f mm", matrix.lever / units::MM);
  std::printf("\nmeasured over applied (modulus +- std, own axis) and condition number\n%8s", "Hz");
  for (std::size_t c = 0; c < matrix.channels; ++c) std::printf("  %-17s", CHANNELS[c]);
  std::printf("condition\n");
  const auto row = [&matrix](std::size_t l) {
    std::printf("%8.0f", matrix.frequency[l]);
    for (Eigen::Index c = 0; c < matrix.forward[l].rows(); ++c)
      std::printf("  %7.3f +- %6.4f", std::abs(matrix.forward[l](c, c)), matrix.forward_std[l](c, c));
    std::printf("  %8.1f\n", matrix.condition[l]);
  };
  std::size_t worst = 0;
  const double spacing = matrix.frequency[1];
  for (int k = 0; k <= 12; ++k)
    row(static_cast<std::size_t>(std::lround((low + (high - low) * k / 12.0) / spacing)));
  for (std::size_t l = 0; l < matrix.frequency.size(); ++l) {
    if (matrix.frequency[l] >= low && matrix.frequency[l] <= high &&
        matrix.condition[l] > matrix.condition[worst])
      worst = l;
  }
  std::printf("largest condition number %.1f at %.0f Hz\n", matrix.condition[worst], matrix.frequency[worst]);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    ModalFitOptions options;
    options.low = low;
    options.high = high;
    options.max_modes = max_modes;
    options.unit_static_gain = true;
    const ModalFit fit = fitModes(matrix.element(axis, axis), options);
    std::printf("\n%s: static gain 1, misfit %.2f %%", CHANNELS[axis], 100.0 * fit.relative_error);
    for (const Mode& mode : fit.model.modes) {
      std::printf("; %.1f +- %.1f Hz, damping %.4f +- %.4f, gain %.4f +- %.4f", mode.frequency,
                  mode.frequency_std, mode.damping_ratio, mode.damping_ratio_std, mode.gain, mode.gain_std);
    }
    std::printf(
        "\n  %-32s states  cond(A)  1/cond > eps  stable  slowest 1/s  rank(O)  cond(O)  observable  "
        "margin\n",
        "state space (Burzoni 4.4)");
    for (const kalman::StateSpaceCheck& c : kalman::checkSensor(fit.model)) {
      // A constant force is a pole at zero: A has no inverse and needs none.
      const bool integrates = !std::isfinite(c.condition);
      std::printf("  %-32s %6d  %7s  %-12s  %-6s  %11.1f  %7d  %7.1e  %-10s  %.1e\n", c.form.c_str(),
                  c.states, integrates ? "    -" : formatted("%7.1e", c.condition).c_str(),
                  integrates      ? "pole at 0"
                  : c.conditioned ? "yes"
                                  : "NO",
                  c.stable ? "yes" : "NO", c.slowest, c.rank, c.observability_condition,
                  c.observable ? "yes" : "NO", c.margin);
    }
    const kalman::Balanced balanced = kalman::balanceTo(stateSpace(fit.model), 1e-3);
    std::printf("  Hankel singular values");
    for (const double h : balanced.hankel) std::printf(" %.4g", h);
    std::printf("; balanced truncation keeps %ld of %zu states, error at most %.2g\n",
                static_cast<long>(balanced.space.a.rows()), balanced.hankel.size(), balanced.bound);
  }
}

struct Request {
  std::string source, out;
  double low = 100.0, high = 0.0;  // [Hz]
  int max_modes = 4;
};

bool isTapFile(const std::filesystem::path& source) {
  return source.extension() == ".yaml" && source.filename() != "campaign.yaml";
}

void run(const Request& request) {
  const Taps taps =
      isTapFile(request.source) ? kalman::readTapFile(request.source) : fromCampaign(request.source);
  const TransferMatrix matrix = kalman::identifyTransferMatrix(taps.taps, taps.rate);
  const double limit = determinedUpTo(matrix, request.low);
  const double high = request.high == 0.0 ? limit : request.high;
  if (!(request.low >= 0.0 && high > request.low && high < 0.5 * taps.rate))
    throw Error("--low-hz, --high-hz: expected 0 <= low < high < half the sample rate");
  std::printf("the taps determine every element to 0.1 up to %.0f Hz\n", limit);
  report(matrix, request.low, high, request.max_modes);
  if (request.out.empty()) return;
  writeMatrix(matrix.band(request.low, high), request.out);
  std::printf("written to %s\n", request.out.c_str());
}

}  // namespace

namespace smartmill::kalman {

Command sensorReportCommand() {
  Command command("sensor-report",
                  "identifies the transfer matrix of a force sensor from taps and checks it");
  command.description =
      "Transfer matrix of a force sensor from all taps (3x3, or 6x6 with moments), with standard deviations, "
      "condition number, stability and observability.";
  command.examples = {
      {"campaigns/cross_talk", "taps of a campaign, in the band where they determine the matrix"},
      {"taps.yaml --high-hz 2000 -o matrix.csv", "taps in files of their own; every line as CSV"}};
  command.files = {{"SOURCE/campaign.yaml", "campaign with taps"},
                   {"TAPS.yaml", "taps in files of their own (smartmill-taps/1)"},
                   {"OUT", "CSV of both matrices with standard deviations"}};
  command.setBody(run, [](CommandLine& line, Request& r) {
    line.option(
            "SOURCE", r.source,
            "campaign folder with taps, or a smartmill-taps/1 file (sample_rate_hz, channels 3 or 6, taps: "
            "file, direction, point_mm; columns hammer[N], fx[N] .. mz[Nm])")
        .required();
    line.option("-o,--out", r.out, "CSV of every line: both matrices with standard deviations");
    line.option("--low-hz", r.low, "lower end of the report's band").showDefault();
    line.option("--high-hz", r.high,
                "upper end of the band; 0: as far as the taps determine the matrix to 0.1")
        .showDefault();
    line.option("--max-modes", r.max_modes, "largest number of modes of an axis").showDefault();
  });
  return command;
}

}  // namespace smartmill::kalman
