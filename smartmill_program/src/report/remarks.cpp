#include "smartmill_program/report/remarks.h"

#include <cmath>
#include <functional>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::MM;

/// Blocks beyond a limit, which the remark on the first of them names.
class Remark {
 public:
  using Text = std::function<std::string(const BlockSummary&)>;

  void add(const BlockSummary& block, bool beyond, const Text& text) {
    if (!beyond) return;
    if (count_++ == 0) text_ = formatted("line %d (%s): ", block.line, block.label().c_str()) + text(block);
  }
  void writeTo(std::vector<std::string>& remarks) const {
    if (count_ == 0) return;
    remarks.push_back(text_ + (count_ > 1 ? formatted(" (and %zu more blocks)", count_ - 1) : ""));
  }

 private:
  std::size_t count_ = 0;
  std::string text_;
};

}  // namespace

std::vector<std::string> remarksOn(const std::vector<BlockSummary>& blocks, ToolModels& models) {
  constexpr double BEYOND = 1.0 + 1e-6;  // [1] despite rounding
  Remark chatter, torque, power, speed, feed;
  for (const BlockSummary& block : blocks) {
    if (block.cut_time == 0.0) continue;
    const MachineModel& model = models.of(block.tool);
    chatter.add(block, block.margin < 1.0, [](const BlockSummary& b) {
      return formatted("chatter is predicted at an axial depth of %.3g mm; the limit is %.3g mm at %.0f rpm",
                       b.axial_depth / MM, b.margin * b.axial_depth / MM, units::rpmFromRadPerSec(b.speed));
    });
    if (model.axes)
      feed.add(block, block.feed > BEYOND * model.axes->rapid, [&](const BlockSummary& b) {
        return formatted("feed of %.4g mm/min; the rapid feed of the axes is %.4g mm/min", 60.0 * b.feed / MM,
                         60.0 * model.axes->rapid / MM);
      });
    if (!model.spindle) continue;
    const Spindle& spindle = *model.spindle;
    if (spindle.rated_torque)
      torque.add(block, block.peak_torque > BEYOND * *spindle.rated_torque, [&](const BlockSummary& b) {
        return formatted("peak torque of %.3g N m; that of the spindle is %.3g N m", b.peak_torque,
                         *spindle.rated_torque);
      });
    if (spindle.rated_power)
      power.add(block, block.power > BEYOND * *spindle.rated_power, [&](const BlockSummary& b) {
        return formatted("cutting power of %.4g W; that of the spindle is %.4g W", b.power,
                         *spindle.rated_power);
      });
    if (spindle.max_speed)
      speed.add(block, block.speed > BEYOND * *spindle.max_speed, [&](const BlockSummary& b) {
        return formatted("spindle speed of %.0f rpm; the highest is %.0f rpm",
                         units::rpmFromRadPerSec(b.speed), units::rpmFromRadPerSec(*spindle.max_speed));
      });
  }
  std::vector<std::string> remarks;
  for (const Remark* remark : {&chatter, &torque, &power, &speed, &feed}) remark->writeTo(remarks);
  return remarks;
}

}  // namespace smartmill::program
