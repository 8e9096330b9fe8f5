#include "smartmill_exchange/items/translator.h"

#include <limits>
#include <map>

#include "items/declarations.h"
#include "smartmill_core/units.h"
#include "smartmill_exchange/items/catalogue.h"
#include "smartmill_recording/conversions.h"

namespace smartmill::exchange {
namespace {

constexpr double NEVER = -std::numeric_limits<double>::infinity();
constexpr double RESTART =
    1.0;  // [s] a stamp this far behind the last one of its topic: a recording was restarted
constexpr double ROUNDING = 1e-6;  // [s] of stamps

/// What has been received of one topic.
struct Topic {
  double received = NEVER, stamp = NEVER, sampled = NEVER;  // [s]
};

Asset coefficientsAsset(const plain::CuttingCoefficients& m) {
  Asset asset{assetId({"coefficients", m.tool, m.material}), "CuttingCoefficients", toSec(m.header.stamp)};
  asset.labels = {{"tool", m.tool},
                  {"material", m.material},
                  {"source", m.source},
                  {"tests", std::to_string(m.test_count)}};
  asset.quantities = {{"ktc", "N/m2", m.ktc, m.ktc_std},
                      {"krc", "N/m2", m.krc, m.krc_std},
                      {"kac", "N/m2", m.kac, m.kac_std},
                      {"kte", "N/m", m.kte, m.kte_std},
                      {"kre", "N/m", m.kre, m.kre_std},
                      {"kae", "N/m", m.kae, m.kae_std},
                      {"friction_viscous", "N m s/rad", m.friction_viscous},
                      {"friction_coulomb", "N m", m.friction_coulomb}};
  return asset;
}

Asset modesAsset(const plain::ModalModel& m) {
  Asset asset{assetId({"modes", m.tool, m.point, m.direction}), "ToolModes", toSec(m.header.stamp)};
  asset.labels = {{"tool", m.tool}, {"point", m.point}, {"direction", m.direction}};
  asset.quantities = {{"direct", m.unit, m.direct, m.direct_std}, {"relative_error", "1", m.relative_error}};
  for (const plain::Mode& mode : m.modes)
    asset.groups.push_back({"mode",
                            {{"frequency", "Hz", mode.frequency, mode.frequency_std},
                             {"damping_ratio", "1", mode.damping_ratio, mode.damping_ratio_std},
                             {"gain", m.unit, mode.gain, mode.gain_std}}});
  return asset;
}

Asset chartAsset(const plain::StabilityChart& m) {
  Asset asset{assetId({"chart", m.tool, m.material}), "StabilityChart", toSec(m.header.stamp)};
  asset.labels = {{"tool", m.tool}, {"material", m.material}, {"method", m.method}};
  asset.quantities = {{"entry_angle", "rad", m.entry_angle},
                      {"exit_angle", "rad", m.exit_angle},
                      {"feed_per_tooth", "m", m.feed_per_tooth},
                      {"absolute_depth_limit", "m", m.absolute_depth_limit}};
  for (const plain::StabilityPoint& p : m.recommended)
    asset.groups.push_back({"recommended",
                            {{"spindle_speed", "rad/s", p.spindle_speed},
                             {"axial_depth", "m", p.axial_depth},
                             {"depth_limit", "m", p.depth_limit},
                             {"chatter_frequency", "Hz", p.chatter_frequency},
                             {"torque", "N m", p.torque},
                             {"power", "W", p.power},
                             {"material_removal_rate", "m3/s", p.material_removal_rate}}});
  return asset;
}

}  // namespace

class Translator::Impl {
 public:
  Impl(const TranslatorParameters& parameters, Sink sink)
      : parameters_(parameters),
        sink_(std::move(sink)),
        last_(catalogue().size()),
        features_(parameters.force_interval) {
    checkBounds(parameters);
    std::size_t first = 0;
    declarations().forEach([&](const auto& list) {
      first_[list.items.front().item.id] = first;
      first += list.items.size();
    });
  }

  template <class Message>
  void take(const ItemsOf<Message>& list, const Message& message, double stamp, double received) {
    Topic& topic = begin(list.topic, stamp, received);
    const bool samples = stamp - topic.sampled >= parameters_.sample_period - ROUNDING;
    const std::size_t first = first_.at(list.items.front().item.id);
    for (std::size_t i = 0; i < list.items.size(); ++i) {
      const Declared<Message>& declared = list.items[i];
      if (samples || declared.item.category != Category::sample || isUnavailable(first + i))
        observe({first + i, stamp, declared.value(message, picture_)});
    }
    if (samples) topic.sampled = stamp;
  }

  /// Of a message whose items follow from others.
  Topic& begin(const char* name, double stamp, double received) {
    Topic& topic = topics_[name];
    if (stamp < topic.stamp - RESTART) restart(stamp);
    Topic& current = topics_[name];
    current.received = received;
    current.stamp = stamp;
    return current;
  }

  void store(const Asset& asset) {
    sink_.store(asset);
    observe({indexOf("asset_changed"), asset.time, Text{asset.id, asset.type}}, true);
  }

  void takeFeatures(double received) {
    for (const ForceFeatures& features : features_.take())
      take(declarations().features, features, features.stamp, received);
  }

  void tick(double now) {
    declarations().forEach([&](const auto& list) {
      const auto topic = topics_.find(list.topic);
      if (!list.live || topic == topics_.end() || now - topic->second.received <= parameters_.input_timeout)
        return;
      const std::size_t first = first_.at(list.items.front().item.id);
      for (std::size_t i = 0; i < list.items.size(); ++i) observe({first + i, now, Unavailable{}});
    });
  }

  Picture& picture() { return picture_; }
  ForceFeatureMaker& features() { return features_; }

 private:
  bool isUnavailable(std::size_t item) const { return std::holds_alternative<Unavailable>(last_[item]); }

  void observe(const Observation& observation, bool always = false) {
    Value& last = last_[observation.item];
    if (!always && last == observation.value) return;
    last = observation.value;
    sink_.observe(observation);
  }

  void restart(double stamp) {
    topics_.clear();
    picture_ = {};
    features_.reset();
    for (std::size_t i = 0; i < last_.size(); ++i) observe({i, stamp, Unavailable{}});
  }

  TranslatorParameters parameters_;
  Sink sink_;
  std::map<std::string, Topic> topics_;
  std::map<std::string, std::size_t> first_;  // index of a list's first item, by the id of that
  std::vector<Value> last_;
  Picture picture_;
  ForceFeatureMaker features_;
};

Translator::Translator(const TranslatorParameters& parameters, Sink sink)
    : impl_(std::make_unique<Impl>(parameters, std::move(sink))) {
}

Translator::~Translator() = default;

void Translator::tick(double now) {
  impl_->tick(now);
}

void Translator::take(const plain::CncState& m, double received) {
  impl_->take(declarations().state, m, toSec(m.header.stamp), received);
}

void Translator::take(const plain::CncAlarms& m, double received) {
  impl_->take(declarations().alarms, m, toSec(m.header.stamp), received);
}

void Translator::take(const plain::LoadSample& m, double received) {
  impl_->take(declarations().load, m, toSec(m.header.stamp), received);
}

void Translator::take(const plain::MachineTemperature& m, double received) {
  impl_->take(declarations().temperature, m, toSec(m.header.stamp), received);
}

void Translator::take(const plain::CuttingCondition& m, double received) {
  impl_->picture().condition = m;
  impl_->features().setTool(m.kind == plain::CuttingCondition::CUT ? static_cast<int>(m.teeth) : 0,
                            0.5 * (m.entry_angle + m.exit_angle));
  impl_->take(declarations().condition, m, toSec(m.header.stamp), received);
}

void Translator::take(const plain::SpindleAngle& m, double received) {
  impl_->begin(names::SPINDLE_ANGLE, toSec(m.header.stamp), received);
  impl_->features().push(fromMsg(m));
  impl_->takeFeatures(received);
}

void Translator::take(const plain::ForceBlock& m, double received) {
  ForceBlock block = fromMsg(m);
  if (block.isUnusable()) {
    for (std::vector<double>& axis : block.force) axis.assign(axis.size(), NOT_A_NUMBER);
  }
  impl_->features().push(block);
  impl_->takeFeatures(received);
}

void Translator::take(const plain::ForceEstimate& m, double received) {
  impl_->take(declarations().estimate, m, toSec(m.header.stamp), received);
}

void Translator::take(const plain::ForceSensorState& m, double received) {
  impl_->take(declarations().sensor, m, toSec(m.header.stamp), received);
}

void Translator::take(const plain::ChatterState& m, double received) {
  impl_->take(declarations().chatter, m, toSec(m.header.stamp), received);
}

void Translator::take(const plain::SpindleHealth& m, double received) {
  impl_->take(declarations().health, m, toSec(m.header.stamp), received);
}

void Translator::take(const plain::CuttingCoefficients& m, double received) {
  impl_->begin(names::COEFFICIENTS, toSec(m.header.stamp), received);
  impl_->picture().coefficients = m;
  impl_->store(coefficientsAsset(m));
}

void Translator::take(const plain::ModalModel& m, double received) {
  impl_->begin(names::TOOL_MODES, toSec(m.header.stamp), received);
  impl_->store(modesAsset(m));
}

void Translator::take(const plain::StabilityChart& m, double received) {
  impl_->begin(names::STABILITY_CHART, toSec(m.header.stamp), received);
  impl_->picture().chart = m;
  impl_->store(chartAsset(m));
}

}  // namespace smartmill::exchange
