#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "smartmill_core/signal/streams.h"
#include "smartmill_exchange/items/data_item.h"
#include "smartmill_exchange/items/force_features.h"
#include "smartmill_exchange/items/observation.h"
#include "smartmill_recording/messages.h"

namespace smartmill::exchange {

/// Content of earlier messages that later values need.
struct Picture {
  std::optional<plain::CuttingCondition> condition;
  std::optional<plain::StabilityChart> chart;
  std::optional<plain::CuttingCoefficients> coefficients;
};

/// A data item with the way in which its value follows from a message.
template <class Message>
struct Declared {
  DataItem item;
  std::function<Value(const Message&, const Picture&)> value;
};

/// The items of one topic.
template <class Message>
struct ItemsOf {
  const char* topic;
  bool live;  ///< published continuously: silence means that there is no value
  std::vector<Declared<Message>> items;
};

/// The declaration of every item, in the order of their indices.
struct Declarations {
  ItemsOf<plain::CncState> state;
  ItemsOf<plain::CncAlarms> alarms;
  ItemsOf<plain::LoadSample> load;
  ItemsOf<plain::MachineTemperature> temperature;
  ItemsOf<plain::CuttingCondition> condition;
  ItemsOf<ForceFeatures> features;
  ItemsOf<plain::ForceEstimate> estimate;
  ItemsOf<plain::ForceSensorState> sensor;
  ItemsOf<plain::ChatterState> chatter;
  ItemsOf<plain::SpindleHealth> health;
  std::vector<DataItem> of_assets;  ///< set when an asset is stored

  template <class Visit>
  void forEach(Visit&& visit) const {
    visit(state);
    visit(alarms);
    visit(load);
    visit(temperature);
    visit(condition);
    visit(features);
    visit(estimate);
    visit(sensor);
    visit(chatter);
    visit(health);
  }
};

const Declarations& declarations();

ItemsOf<plain::CncState> stateItems();
ItemsOf<plain::CncAlarms> alarmItems();
ItemsOf<plain::LoadSample> loadItems();
ItemsOf<plain::MachineTemperature> temperatureItems();
ItemsOf<plain::CuttingCondition> conditionItems();
ItemsOf<ForceFeatures> featureItems();
ItemsOf<plain::ForceEstimate> estimateItems();
ItemsOf<plain::ForceSensorState> sensorItems();
ItemsOf<plain::ChatterState> chatterItems();
ItemsOf<plain::SpindleHealth> healthItems();

/// Text of an event; empty: unavailable.
inline Value textOrNone(const std::string& text) {
  return text.empty() ? Value(Unavailable{}) : Value(Text{text});
}

}  // namespace smartmill::exchange
