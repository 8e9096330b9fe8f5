#include <cstring>

#include "fuzz/input_file.h"
#include "fuzz/targets.h"
#include "smartmill_ros/bag_reader.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::fuzz {
namespace {

template <class Message>
void hear(BagReader& reader, const char* topic) {
  reader.on<Message>(topic, [](const Message& message, double) { told([&] { fromMsg(message); }); });
}

}  // namespace

void bag(const std::uint8_t* data, std::size_t size) {
  BagBytes bytes;
  bytes.size = size;
  bytes.read = [data](std::uint64_t at, char* to, std::size_t count) {
    if (count > 0) {
      std::memcpy(to, data + at, count);
    }
  };
  told([&] {
    BagReader reader(bytes, "fuzzed");
    hear<smartmill_msgs::SampleBlock>(reader, names::HAMMER);
    hear<smartmill_msgs::SpindleAngle>(reader, names::SPINDLE_ANGLE);
    hear<smartmill_msgs::CncState>(reader, names::CNC_STATE);
    hear<smartmill_msgs::LoadSample>(reader, names::CNC_LOAD);
    hear<smartmill_msgs::CuttingCondition>(reader, names::CUTTING_CONDITION);
    hear<smartmill_msgs::ForceBlock>(reader, names::FORCE_COMPENSATED);
    hear<smartmill_msgs::Frf>(reader, names::TOOL_FRF);
    hear<smartmill_msgs::ModalModel>(reader, names::TOOL_MODES);
    hear<smartmill_msgs::CuttingCoefficients>(reader, names::COEFFICIENTS);
    hear<smartmill_msgs::StabilityChart>(reader, names::STABILITY_CHART);
    reader.run();
    reader.duration();
  });
}

}  // namespace smartmill::fuzz
