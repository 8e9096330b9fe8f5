#include "smartmill_exchange/mtconnect/shdr.h"

#include <algorithm>

#include "smartmill_exchange/items/catalogue.h"
#include "smartmill_exchange/mtconnect/asset_document.h"

namespace smartmill::exchange {
namespace {

constexpr const char* UNAVAILABLE = "UNAVAILABLE";

/// Without the characters that end a value or a line.
std::string field(const std::string& text) {
  std::string plain = text;
  for (char& c : plain)
    if (static_cast<unsigned char>(c) < ' ' || c == '|') c = ' ';
  return plain;
}

std::string valueText(const Value& value) {
  if (const auto* number = std::get_if<double>(&value)) return numberText(*number);
  if (const auto* text = std::get_if<Text>(&value))
    return text->asset_type.empty() ? field(text->text) : field(text->asset_type) + "|" + field(text->text);
  if (const auto* set = std::get_if<DataSet>(&value)) {
    std::string entries;
    for (const auto& [key, number] : *set)
      entries += (entries.empty() ? "" : " ") + key + "=" + numberText(number);
    return entries;
  }
  return UNAVAILABLE;
}

const char* levelText(ConditionChange::Level level) {
  using Level = ConditionChange::Level;
  return level == Level::unavailable ? UNAVAILABLE
         : level == Level::normal    ? "normal"
         : level == Level::warning   ? "warning"
                                     : "fault";
}

std::string assetLines(const Asset& asset, const std::string& uuid) {
  // The tag follows from the id, which holds neither bars nor line breaks; a document never contains it at
  // the start of a line.
  const std::string tag = "--multiline--" + asset.id;
  return timeText(asset.time) + "|@ASSET@|" + asset.id + "|" + asset.type + "|" + tag + "\n" +
         assetXml(asset, uuid) + "\n" + tag + "\n";
}

}  // namespace

ShdrWriter::ShdrWriter(std::string device_uuid) : uuid_(std::move(device_uuid)), last_(catalogue().size()) {
}

std::string ShdrWriter::observe(const Observation& observation) {
  Observation& last = last_[observation.item];
  const Value before = last.value;
  last = observation;
  return lines(observation, before);
}

std::string ShdrWriter::lines(const Observation& observation, const Value& before) const {
  const DataItem& item = catalogue()[observation.item];
  // The agent itself reports changes of assets.
  if (item.source == "assets") return {};
  const std::string begin = timeText(observation.time) + "|" + item.id + "|";
  if (item.category != Category::condition) return begin + valueText(observation.value) + "\n";
  std::string text;
  for (const ConditionChange& change : changesOf(before, observation.value))
    text += begin + levelText(change.level) + "|" + field(change.code) + "|||" + field(change.text) + "\n";
  return text;
}

std::string ShdrWriter::store(const Asset& asset) {
  assets_[asset.id] = asset;
  return assetLines(asset, uuid_);
}

std::string ShdrWriter::greeting(double now) const {
  std::string text = "* adapterVersion: SmartMill\n* shdrVersion: 2.0\n* mtconnectVersion: 1.8\n";
  for (std::size_t i = 0; i < last_.size(); ++i) {
    Observation observation = last_[i];
    observation.item = i;
    if (observation.time == 0.0) observation.time = now;
    text += lines(observation, Unavailable{});
  }
  for (const auto& [id, asset] : assets_) text += assetLines(asset, uuid_);
  return text;
}

int ShdrCommands::push(const char* data, std::size_t size) {
  int pings = 0;
  for (std::size_t i = 0; i < size; ++i) {
    if (data[i] != '\n') {
      too_long_ = too_long_ || line_.size() >= LONGEST;
      if (!too_long_) line_ += data[i];
      continue;
    }
    while (!line_.empty() && (line_.back() == '\r' || line_.back() == ' ')) line_.pop_back();
    if (!too_long_ && line_ == "* PING") ++pings;
    line_.clear();
    too_long_ = false;
  }
  return pings;
}

}  // namespace smartmill::exchange
