#include "session_bag.h"

#include <cmath>
#include <limits>

#include <smartmill_msgs/ChatterState.h>
#include <smartmill_msgs/StabilityChart.h>

#include "smartmill_core/names.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_ros/bag_reader.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::report {
namespace {

constexpr double PATH_TOLERANCE = 1e-3;   // [m]
constexpr double SPEED_TOLERANCE = 0.01;  // [1]

/// Gathers messages in the order of their reception.
class Gatherer {
 public:
  explicit Gatherer(SessionRecording& recording) : recording_(recording) {}

  void attach(BagReader& bag) {
    bag.on<smartmill_msgs::Frf>(names::TOOL_FRF, [this](const auto& m, double) { keep(recording_.frfs, m); });
    bag.on<smartmill_msgs::Frf>(names::TRUE_FRF,
                                [this](const auto& m, double) { keep(recording_.true_frfs, m); });
    bag.on<smartmill_msgs::ModalModel>(names::TOOL_MODES,
                                       [this](const auto& m, double) { keep(recording_.modes, m); });
    bag.on<smartmill_msgs::ModalModel>(names::TRUE_MODES,
                                       [this](const auto& m, double) { keep(recording_.true_modes, m); });
    bag.on<smartmill_msgs::CuttingCoefficients>(
        names::COEFFICIENTS, [this](const auto& m, double) { recording_.coefficients = fromMsg(m); });
    bag.on<smartmill_msgs::CuttingCoefficients>(names::TRUE_COEFFICIENTS, [this](const auto& m, double) {
      recording_.true_coefficients = fromMsg(m);
    });
    bag.on<smartmill_msgs::StabilityChart>(names::STABILITY_CHART,
                                           [this](const auto& m, double) { recording_.chart = fromMsg(m); });
    bag.on<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION,
                                             [this](const auto& m, double) { take(fromMsg(m)); });
    bag.on<smartmill_msgs::CncState>(names::CNC_STATE, [this](const auto& m, double) { take(fromMsg(m)); });
    bag.on<smartmill_msgs::ChatterState>(names::CHATTER_STATE, [this](const auto& m, double) { take(m); });
    const auto force = [&](const char* topic, ForceTrack RecordedCut::*track) {
      bag.on<smartmill_msgs::ForceBlock>(topic, [this, track](const auto& m, double) {
        RecordedCut* cut = cutAt(m.header.stamp.toSec());
        if (cut) (cut->*track).add(fromMsg(m));
      });
    };
    force(names::FORCE_MEASURED, &RecordedCut::raw);
    force(names::FORCE_COMPENSATED, &RecordedCut::compensated);
    force(names::TRUE_FORCE, &RecordedCut::truth);
  }

 private:
  /// The newest of each point and direction stands.
  template <class Item, class Message>
  static void keep(std::vector<Item>& items, const Message& message) {
    const Item item = fromMsg(message);
    for (Item& other : items) {
      if (other.point == item.point && other.direction == item.direction) {
        other = item;
        return;
      }
    }
    items.push_back(item);
  }

  void take(const CuttingCondition& condition) {
    if (!recording_.cuts.empty()) {
      RecordedCut& last = recording_.cuts.back();
      if (last.condition.stamp == condition.stamp && last.condition.name == condition.name)
        return;  // latched
      if (std::isnan(last.ends)) last.ends = condition.stamp;
    }
    if (condition.kind != CuttingCondition::Kind::cut) return;
    recording_.cuts.emplace_back();
    recording_.cuts.back().condition = condition;
  }

  void take(const CncState& state) {
    RecordedCut* cut = cutAt(state.stamp);
    if (!cut || !onSteadyPath(cut->condition, state, PATH_TOLERANCE)) return;
    const double speed = cut->condition.spindle_speed;
    if (std::abs(state.spindle_speed - speed) > SPEED_TOLERANCE * speed) return;
    if (std::isnan(cut->steady_from)) cut->steady_from = state.stamp;
    cut->steady_to = state.stamp;
  }

  void take(const smartmill_msgs::ChatterState& m) {
    if (!m.valid) return;
    for (RecordedCut& cut : recording_.cuts) {
      if (cut.condition.name == m.condition) {
        cut.windows.push_back({m.chatter != 0, m.frequency, m.severity});
      }
    }
  }

  RecordedCut* cutAt(double stamp) {
    for (auto cut = recording_.cuts.rbegin(); cut != recording_.cuts.rend(); ++cut) {
      if (cut->condition.stamp <= stamp) return stamp < cut->ends || std::isnan(cut->ends) ? &*cut : nullptr;
    }
    return nullptr;
  }

  SessionRecording& recording_;
};

}  // namespace

SessionRecording readSession(const std::string& bag, const std::function<void(double)>& progress) {
  SessionRecording recording;
  BagReader reader(bag);
  Gatherer gatherer(recording);
  gatherer.attach(reader);
  reader.run(progress);
  recording.duration = reader.duration();
  return recording;
}

}  // namespace smartmill::report
