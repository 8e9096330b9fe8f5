#include <cstring>

#include "fuzz/input_file.h"
#include "fuzz/targets.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::fuzz {
namespace {

template <class Data>
void hear(RecordingReader& reader, const char* topic) {
  reader.on<Data>(topic, [](const Data&, double) {});
}

void recordingOf(const std::uint8_t* data, std::size_t size) {
  RecordingBytes bytes;
  bytes.size = size;
  bytes.read = [data](std::uint64_t at, char* to, std::size_t count) {
    if (count > 0) {
      std::memcpy(to, data + at, count);
    }
  };
  readOrRefuse([&] {
    RecordingReader reader(bytes, "fuzzed");
    hear<SampleBlock>(reader, names::HAMMER);
    hear<SpindleAngle>(reader, names::SPINDLE_ANGLE);
    hear<CncState>(reader, names::CNC_STATE);
    hear<LoadSample>(reader, names::CNC_LOAD);
    hear<MachineTemperature>(reader, names::MACHINE_TEMPERATURE);
    hear<InspectionFeature>(reader, names::INSPECTION_FEATURE);
    hear<CuttingCondition>(reader, names::CUTTING_CONDITION);
    hear<ForceBlock>(reader, names::FORCE_COMPENSATED);
    hear<MeasuredFrf>(reader, names::TOOL_FRF);
    hear<MeasuredModes>(reader, names::TOOL_MODES);
    hear<CoefficientSet>(reader, names::COEFFICIENTS);
    hear<StabilityChart>(reader, names::STABILITY_CHART);
    reader.run();
    reader.duration();
  });
}

}  // namespace

// The first bytes of the corpus decide which reader runs.
void bag(const std::uint8_t* data, std::size_t size) {
  recordingOf(data, size);
}

void mcap(const std::uint8_t* data, std::size_t size) {
  recordingOf(data, size);
}

}  // namespace smartmill::fuzz
