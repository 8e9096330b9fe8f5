#include "smartmill_kalman/sensor/tap_file.h"

#include <filesystem>
#include <iterator>
#include <utility>

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

}  // namespace smartmill::kalman
