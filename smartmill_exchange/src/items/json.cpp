#include "smartmill_exchange/items/json.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "smartmill_exchange/items/catalogue.h"

namespace smartmill::exchange {
namespace {

using Json = nlohmann::ordered_json;

/// With the digits that all protocols print.
Json numberJson(double value) {
  return std::isfinite(value) ? Json(std::stod(numberText(value))) : Json(nullptr);
}

Json valueJson(const Value& value) {
  if (const auto* number = std::get_if<double>(&value)) return numberJson(*number);
  if (const auto* text = std::get_if<Text>(&value)) return text->text;
  if (const auto* set = std::get_if<DataSet>(&value)) {
    Json object = Json::object();
    for (const auto& [key, number] : *set) object[key] = numberJson(number);
    return object;
  }
  if (const auto* active = std::get_if<Activations>(&value)) {
    Json list = Json::array();
    for (const Activation& a : *active)
      list.push_back({{"level", a.fault ? "fault" : "warning"}, {"code", a.code}, {"text", a.text}});
    return list;
  }
  return nullptr;
}

Json quantitiesJson(const std::vector<Quantity>& quantities) {
  Json object = Json::object();
  for (const Quantity& q : quantities) {
    if (!std::isfinite(q.value)) continue;
    object[q.name] = {{"value", numberJson(q.value)}, {"units", q.unit}};
    if (std::isfinite(q.std_dev)) object[q.name]["std"] = numberJson(q.std_dev);
  }
  return object;
}

/// Invalid UTF-8 of a controller's texts is replaced.
std::string dumped(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

Json ids(Category category, bool set) {
  Json list = Json::array();
  for (const DataItem& item : catalogue())
    if (item.category == category && item.set == set) list.push_back(item.id);
  return list;
}

Json rule(const Json& of_ids, const Json& value) {
  return {{"if", {{"properties", {{"id", {{"enum", of_ids}}}}}}},
          {"then", {{"properties", {{"value", value}}}}}};
}

}  // namespace

std::string observationJson(const Observation& observation) {
  const DataItem& item = catalogue()[observation.item];
  Json json = {
      {"id", item.id}, {"time", timeText(observation.time)}, {"value", valueJson(observation.value)}};
  if (!item.units.empty()) json["units"] = item.units;
  const auto* text = std::get_if<Text>(&observation.value);
  if (text && !text->asset_type.empty()) json["assetType"] = text->asset_type;
  return dumped(json);
}

std::string assetJson(const Asset& asset) {
  Json json = {
      {"id", asset.id}, {"type", asset.type}, {"time", timeText(asset.time)}, {"labels", Json::object()}};
  for (const auto& [label, text] : asset.labels) json["labels"][label] = text;
  json["quantities"] = quantitiesJson(asset.quantities);
  json["groups"] = Json::array();
  for (const QuantityGroup& group : asset.groups)
    json["groups"].push_back({{"name", group.name}, {"quantities", quantitiesJson(group.quantities)}});
  return dumped(json);
}

std::string catalogueJson() {
  Json list = Json::array();
  for (const DataItem& item : catalogue()) {
    Json one = {{"id", item.id}, {"category", nameOf(item.category)}, {"type", item.type}};
    if (!item.sub_type.empty()) one["subType"] = item.sub_type;
    if (!item.statistic.empty()) one["statistic"] = item.statistic;
    if (!item.units.empty()) one["units"] = item.units;
    one["meaning"] = item.meaning;
    one["uncertainty"] = item.uncertainty;
    one["bandwidth"] = item.bandwidth;
    one["topic"] = item.source;
    list.push_back(one);
  }
  return dumped(list);
}

std::string observationSchema() {
  const Json number = {{"type", Json::array({"number", "null"})}};
  const Json text = {{"type", Json::array({"string", "null"})}};
  const Json set = {{"type", Json::array({"object", "null"})},
                    {"additionalProperties", {{"type", "number"}}}};
  const Json activation = {{"type", "object"},
                           {"properties",
                            {{"level", {{"enum", {"warning", "fault"}}}},
                             {"code", {{"type", "string"}}},
                             {"text", {{"type", "string"}}}}},
                           {"required", {"level", "code", "text"}},
                           {"additionalProperties", false}};
  const Json activations = {{"type", Json::array({"array", "null"})}, {"items", activation}};
  Json all = Json::array();
  for (const DataItem& item : catalogue()) all.push_back(item.id);
  const Json schema = {
      {"$schema", "http://json-schema.org/draft-07/schema#"},
      {"title", "SmartMill observation"},
      {"description", "One value of a data item; null: unavailable. Units are those of MTConnect."},
      {"type", "object"},
      {"properties",
       {{"id", {{"enum", all}}},
        {"time",
         {{"type", "string"},
          {"pattern", "^[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}\\.[0-9]{6}Z$"}}},
        {"value", Json::object()},
        {"units", {{"type", "string"}}},
        {"assetType", {{"type", "string"}}}}},
      {"required", {"id", "time", "value"}},
      {"additionalProperties", false},
      {"allOf", Json::array({rule(ids(Category::sample, false), number),
                             rule(ids(Category::sample, true), set), rule(ids(Category::event, false), text),
                             rule(ids(Category::condition, false), activations)})}};
  return dumped(schema, 1) + "\n";
}

}  // namespace smartmill::exchange
