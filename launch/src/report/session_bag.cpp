#include "session_bag.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "smartmill_core/names.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::report {
namespace {

constexpr double PATH_TOLERANCE = 1e-3;   // [m]
constexpr double SPEED_TOLERANCE = 0.01;  // [1]
/// [s] largest latency of a sensor: stamps of the same running index that differ by more are of instruments
/// that count from different samples.
constexpr double LARGEST_LATENCY = 0.1;

/// Fills a SessionRecording from the messages of a bag, in the order of their reception.
class SessionRecordingBuilder {
 public:
  explicit SessionRecordingBuilder(SessionRecording& recording) : recording_(recording) {}

  void attach(RecordingReader& bag) {
    bag.on<MeasuredFrf>(names::TOOL_FRF,
                        [this](const auto& frf, double) { replaceOrAdd(recording_.frfs, frf); });
    bag.on<MeasuredFrf>(names::TRUE_FRF,
                        [this](const auto& frf, double) { replaceOrAdd(recording_.true_frfs, frf); });
    bag.on<MeasuredModes>(names::TOOL_MODES,
                          [this](const auto& modes, double) { replaceOrAdd(recording_.modes, modes); });
    bag.on<MeasuredModes>(names::TRUE_MODES,
                          [this](const auto& modes, double) { replaceOrAdd(recording_.true_modes, modes); });
    bag.on<CoefficientSet>(names::COEFFICIENTS,
                           [this](const auto& set, double) { recording_.coefficients = set; });
    bag.on<CoefficientSet>(names::TRUE_COEFFICIENTS,
                           [this](const auto& set, double) { recording_.true_coefficients = set; });
    bag.on<StabilityChart>(names::STABILITY_CHART,
                           [this](const auto& chart, double) { recording_.chart = chart; });
    bag.on<CuttingCondition>(names::CUTTING_CONDITION,
                             [this](const auto& condition, double) { add(condition); });
    bag.on<CncState>(names::CNC_STATE, [this](const auto& state, double) { add(state); });
    bag.on<plain::ChatterState>(names::CHATTER_STATE, [this](const auto& state, double) { add(state); });
    const auto force = [&](const char* topic, ForceTrack RecordedCut::*track) {
      bag.on<ForceBlock>(topic, [this, track](const auto& block, double) {
        if (RecordedCut* cut = cutAt(block.stamp)) (cut->*track).add(withTrueIndex(block, *cut));
      });
    };
    force(names::FORCE_MEASURED, &RecordedCut::raw);
    force(names::FORCE_COMPENSATED, &RecordedCut::compensated);
    bag.on<ForceBlock>(names::TRUE_FORCE, [this](const auto& block, double) {
      truth_ = {block.stamp, block.first_index};
      if (RecordedCut* cut = cutAt(block.stamp)) cut->truth.add(block);
    });
  }

 private:
  /// Replaces an earlier item of the same point and direction.
  template <class Item>
  static void replaceOrAdd(std::vector<Item>& items, const Item& item) {
    for (Item& other : items) {
      if (other.point == item.point && other.direction == item.direction) {
        other = item;
        return;
      }
    }
    items.push_back(item);
  }

  void add(const CuttingCondition& condition) {
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

  void add(const CncState& state) {
    RecordedCut* cut = cutAt(state.stamp);
    if (!cut || !onSteadyPath(cut->condition, state, PATH_TOLERANCE)) return;
    const double speed = cut->condition.spindle_speed;
    if (std::abs(state.spindle_speed - speed) > SPEED_TOLERANCE * speed) return;
    if (std::isnan(cut->steady_from)) cut->steady_from = state.stamp;
    cut->steady_to = state.stamp;
  }

  void add(const plain::ChatterState& m) {
    if (!m.valid) return;
    for (RecordedCut& cut : recording_.cuts) {
      if (cut.condition.name == m.condition) {
        cut.windows.push_back({m.chatter != 0, m.frequency, m.severity});
      }
    }
  }

  /// The block with the running index of the true force at its stamps: an instrument behind a pipe counts
  /// from a sample of its own. The shift is that of the first block of the cut.
  ForceBlock withTrueIndex(ForceBlock block, const RecordedCut& cut) {
    if (!truth_) return block;
    if (shift_of_ != cut.condition.stamp) {
      const double ahead = (block.stamp - truth_->stamp) * block.sample_rate +
                           static_cast<double>(truth_->index) - static_cast<double>(block.first_index);
      shift_ = std::abs(ahead) > LARGEST_LATENCY * block.sample_rate ? std::llround(ahead) : 0;
      shift_of_ = cut.condition.stamp;
    }
    block.first_index += static_cast<std::uint64_t>(shift_);
    return block;
  }

  RecordedCut* cutAt(double stamp) {
    for (auto cut = recording_.cuts.rbegin(); cut != recording_.cuts.rend(); ++cut) {
      if (cut->condition.stamp <= stamp) return stamp < cut->ends || std::isnan(cut->ends) ? &*cut : nullptr;
    }
    return nullptr;
  }

  struct Sample {
    double stamp;         // [s]
    std::uint64_t index;  // running index
  };

  SessionRecording& recording_;
  std::optional<Sample> truth_;     // the last of the true force
  double shift_of_ = NOT_A_NUMBER;  // [s] start of the cut
  long long shift_ = 0;             // [samples] from the sensor's running index to the true force's
};

}  // namespace

SessionRecording readSession(const std::string& bag, const std::function<void(double)>& progress) {
  SessionRecording recording;
  RecordingReader reader(bag);
  SessionRecordingBuilder builder(recording);
  builder.attach(reader);
  reader.run(progress);
  recording.duration = reader.duration();
  return recording;
}

}  // namespace smartmill::report
