#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/SampleBlock.h>

#include "fuzz/scratch_file.h"
#include "fuzz/targets.h"
#include "smartmill_core/error.h"
#include "smartmill_ros/bag_reader.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::fuzz {

void bag(const std::uint8_t* data, std::size_t size) {
  try {
    BagReader reader(scratchFile(data, size));
    reader.on<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, [](const auto& message, double) { fromMsg(message); });
    reader.on<smartmill_msgs::CncState>(names::CNC_STATE, [](const auto& message, double) { fromMsg(message); });
    reader.on<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION,
                                                [](const auto& message, double) { fromMsg(message); });
    reader.run();
  } catch (const Error&) {
    // Names the file.
  }
}

}  // namespace smartmill::fuzz
