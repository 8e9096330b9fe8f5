#include <yaml-cpp/yaml.h>

#include <cmath>
#include <optional>

#include "calibration/yaml_values.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_daq/alignment/stream_alignment.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {

double storeLatency(const std::string& file, const StreamShift& shift) {
  std::optional<StrictYaml> options;
  const double latency = readInstrument(file, &options).latency + shift.delay;
  if (latency < 0.0)
    throw Error(file +
                formatted(": latency would be %.6f s; the other stream is the late one, store the shift in "
                          "its instrument",
                          latency));
  std::string text = readText(file);
  setValue(text, YAML::Load(text), "latency", yamlNumber(latency, 7), "sample_rate");
  setValue(text, YAML::Load(text), "latency_std", yamlNumber(shift.std_dev, 3), "latency");
  writeChecked(
      file, text, [&] { return std::abs(readInstrument(file, &options).latency - latency) < 1e-6; },
      file + formatted(": latency cannot be stored here, expected latency: %.6f", latency));
  return latency;
}

}  // namespace smartmill::daq
