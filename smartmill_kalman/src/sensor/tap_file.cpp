#include "smartmill_kalman/sensor/tap_file.h"

#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {

TapRecords readTapFile(const std::string& path) {
  const StrictYaml yaml = StrictYaml::fromFile(path);
  yaml.oneOf("format", {"smartmill-taps/1"});
  const int channels = yaml.integer("channels", 3, 6);
  TapRecords found;
  found.rate = yaml.number("sample_rate_hz", Range::positive());
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::vector<std::string> columns{"hammer[N]"};
  for (int c = 0; c < channels; ++c)
    columns.push_back(std::string(PLATE_CHANNELS[static_cast<std::size_t>(c)]) + (c < 3 ? "[N]" : "[Nm]"));
  for (const StrictYaml& entry : yaml.maps("taps")) {
    MatrixTap tap;
    const auto direction = entry.numbers("direction", 3), point = entry.numbers("point_mm", 3);
    for (std::size_t i = 0; i < 3; ++i) {
      tap.direction[i] = direction[i];
      tap.point[i] = point[i] * units::MM;
    }
    auto table = readColumns((folder / entry.word("file")).string(), columns);
    entry.finish();
    tap.hammer = std::move(table[0]);
    tap.channels.assign(std::make_move_iterator(table.begin() + 1), std::make_move_iterator(table.end()));
    found.taps.push_back(std::move(tap));
  }
  yaml.finish();
  return found;
}

void writeTapFile(const TapRecords& records, const std::string& path) {
  const std::filesystem::path file(path);
  const std::size_t channels = records.taps.empty() ? 0 : records.taps.front().channels.size();
  std::ofstream out(path);
  out << "format: smartmill-taps/1\nchannels: " << channels
      << "\nsample_rate_hz: " << yamlNumber(records.rate) << "\ntaps:\n";
  std::string head = "hammer[N]";
  for (std::size_t c = 0; c < channels; ++c)
    head += std::string(",") + PLATE_CHANNELS[c] + (c < 3 ? "[N]" : "[Nm]");
  for (std::size_t t = 0; t < records.taps.size(); ++t) {
    const MatrixTap& tap = records.taps[t];
    const std::string name = file.stem().string() + formatted("_%02zu.csv", t + 1);
    const auto list = [](const std::array<double, 3>& v, double unit) {
      return "[" + yamlNumber(v[0] / unit) + ", " + yamlNumber(v[1] / unit) + ", " + yamlNumber(v[2] / unit) +
             "]";
    };
    out << "- {file: " << yamlWord(name) << ", direction: " << list(tap.direction, 1.0)
        << ", point_mm: " << list(tap.point, units::MM) << "}\n";
    std::ofstream table(file.parent_path() / name);
    table << head << "\n";
    for (std::size_t i = 0; i < tap.hammer.size(); ++i) {
      table << formatted("%.9g", tap.hammer[i]);
      for (const auto& channel : tap.channels) table << formatted(",%.9g", channel[i]);
      table << "\n";
    }
    table.close();
    if (!table) throw Error((file.parent_path() / name).string() + ": cannot write");
  }
  out.close();
  if (!out) throw Error(path + ": cannot write");
}

}  // namespace smartmill::kalman
