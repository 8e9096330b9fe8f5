#include "smartmill_exchange/items/catalogue.h"

#include <map>
#include <stdexcept>

#include "items/declarations.h"
#include "smartmill_core/error.h"

namespace smartmill::exchange {
namespace {

constexpr const char *BEGIN = "<!-- items -->\n", *END = "<!-- /items -->";

std::string cellOf(const DataItem& item) {
  std::string type = item.type;
  for (const std::string& part : {item.sub_type, item.statistic})
    if (!part.empty()) type += ", " + part;
  if (item.set) type += ", DATA_SET";
  return type;
}

}  // namespace

const Declarations& declarations() {
  static const Declarations ALL{
      stateItems(),
      alarmItems(),
      loadItems(),
      temperatureItems(),
      conditionItems(),
      featureItems(),
      estimateItems(),
      sensorItems(),
      chatterItems(),
      healthItems(),
      {{"asset_changed", "", Category::event, "ASSET_CHANGED", "", "", "", false,
        "id of the asset that was added or changed last", "none", "at each change", "assets"},
       {"asset_removed", "", Category::event, "ASSET_REMOVED", "", "", "", false, "no asset is removed",
        "none", "never", "assets"}}};
  return ALL;
}

const std::vector<DataItem>& catalogue() {
  static const std::vector<DataItem> ITEMS = [] {
    std::vector<DataItem> all;
    declarations().forEach([&all](const auto& list) {
      for (const auto& declared : list.items) {
        all.push_back(declared.item);
        all.back().source = list.topic;
      }
    });
    const std::vector<DataItem>& rest = declarations().of_assets;
    all.insert(all.end(), rest.begin(), rest.end());
    return all;
  }();
  return ITEMS;
}

std::size_t indexOf(const std::string& id) {
  static const std::map<std::string, std::size_t> INDICES = [] {
    std::map<std::string, std::size_t> all;
    for (std::size_t i = 0; i < catalogue().size(); ++i) all[catalogue()[i].id] = i;
    return all;
  }();
  return INDICES.at(id);
}

const char* nameOf(Category category) {
  return category == Category::sample ? "SAMPLE" : category == Category::event ? "EVENT" : "CONDITION";
}

std::string withItemTable(const std::string& document) {
  const std::size_t begin = document.find(BEGIN), end = document.find(END);
  if (begin == std::string::npos || end == std::string::npos || end < begin)
    throw Error("no table between the lines <!-- items --> and <!-- /items -->");
  std::string table =
      "\n| item | category, type | units | meaning | uncertainty | bandwidth | topic "
      "|\n|---|---|---|---|---|---|---|\n";
  for (const DataItem& item : catalogue())
    table += "| `" + item.id + "` | " + nameOf(item.category) + " " + cellOf(item) + " | " + item.units +
             " | " + item.meaning + " | " + item.uncertainty + " | " + item.bandwidth + " | " + item.source +
             " |\n";
  return document.substr(0, begin) + BEGIN + table + "\n" + document.substr(end);
}

}  // namespace smartmill::exchange
