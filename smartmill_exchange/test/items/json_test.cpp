#include "smartmill_exchange/items/json.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "smartmill_exchange/items/catalogue.h"

namespace smartmill::exchange {
namespace {

using nlohmann::json;

json jsonOf(const std::string& id, const Value& value) {
  return json::parse(observationJson({indexOf(id), 951782400.25, value}));
}

TEST(Json, ValuesOfEachCategory) {
  EXPECT_EQ(jsonOf("feed", 1.0 / 3.0),
            json::parse(R"({"id": "feed", "time": "2000-02-29T00:00:00.250000Z", "value": 0.333333333,
                                                       "units": "MILLIMETER/SECOND"})"));
  EXPECT_EQ(jsonOf("feed", Unavailable{})["value"], nullptr);
  EXPECT_EQ(jsonOf("program", Text{"O1234 \xff"})["value"],
            "O1234 \xef\xbf\xbd");  // invalid UTF-8 is replaced
  EXPECT_EQ(jsonOf("force_error", DataSet{{"x", 1.5}})["value"], json({{"x", 1.5}}));
  EXPECT_EQ(jsonOf("alarms", Activations{{true, "1", "a"}})["value"],
            json::parse(R"([{"level": "fault", "code": "1", "text": "a"}])"));
  EXPECT_EQ(jsonOf("alarms", Activations{})["value"], json::array());
  EXPECT_EQ(jsonOf("asset_changed", Text{"id", "ToolModes"})["assetType"], "ToolModes");
}

TEST(Json, AssetsWithDeviations) {
  Asset asset{"modes.a", "ToolModes", 0.0};
  asset.labels = {{"tool", "a"}};
  asset.quantities = {{"direct", "m/N", 1e-9, 2e-10}};
  asset.groups = {{"mode", {{"frequency", "Hz", 930.0}, {"gain", "m/N", NAN}}}};
  EXPECT_EQ(json::parse(assetJson(asset)),
            json::parse(R"({"id": "modes.a", "type": "ToolModes", "time": "1970-01-01T00:00:00.000000Z",
    "labels": {"tool": "a"}, "quantities": {"direct": {"value": 1e-9, "units": "m/N", "std": 2e-10}},
    "groups": [{"name": "mode", "quantities": {"frequency": {"value": 930.0, "units": "Hz"}}}]})"));
}

}  // namespace
}  // namespace smartmill::exchange
