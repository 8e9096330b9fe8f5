#include "smartmill_exchange/items/catalogue.h"

#include <map>
#include <regex>
#include <set>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_exchange/items/json.h"

namespace smartmill::exchange {
namespace {

TEST(Catalogue, IdsAreUniqueXmlNamesOfKnownComponents) {
  std::set<std::string> ids, parts{""};
  for (const Component& c : components()) {
    EXPECT_TRUE(parts.count(c.parent)) << c.id;
    EXPECT_TRUE(ids.insert(c.id).second) << c.id;
    parts.insert(c.id);
  }
  for (const DataItem& item : catalogue()) {
    EXPECT_TRUE(std::regex_match(item.id, std::regex("[a-z][a-z0-9_]*"))) << item.id;
    EXPECT_TRUE(ids.insert(item.id).second) << item.id;
    EXPECT_TRUE(parts.count(item.component)) << item.id;
    EXPECT_FALSE(item.meaning.empty() || item.uncertainty.empty() || item.bandwidth.empty() ||
                 item.source.empty())
        << item.id;
    EXPECT_EQ(catalogue()[indexOf(item.id)].id, item.id);
  }
}

// Types and units of samples: MTConnect Standard, Part 2, version 1.8, table of data item types of category
// SAMPLE; the pattern of an extended type is that of its schema.
TEST(Catalogue, TypesAndUnitsAreThoseOfTheStandard) {
  const std::map<std::string, std::string> units{{"POSITION", "MILLIMETER"},
                                                 {"LOAD", "PERCENT"},
                                                 {"ROTARY_VELOCITY", "REVOLUTION/MINUTE"},
                                                 {"PATH_FEEDRATE", "MILLIMETER/SECOND"},
                                                 {"TORQUE", "NEWTON_METER"},
                                                 {"LINEAR_FORCE", "NEWTON"},
                                                 {"FREQUENCY", "HERTZ"},
                                                 {"TEMPERATURE", "CELSIUS"}};
  const std::set<std::string> events{"AVAILABILITY", "EMERGENCY_STOP", "CONTROLLER_MODE",
                                     "EXECUTION",    "PROGRAM",        "LINE_LABEL",
                                     "MATERIAL",     "ASSET_CHANGED",  "ASSET_REMOVED"};
  const std::set<std::string> conditions{"COMMUNICATIONS", "SYSTEM", "HARDWARE"};
  const std::set<std::string> statistics{"", "AVERAGE", "MAXIMUM", "ROOT_MEAN_SQUARE", "STANDARD_DEVIATION"};
  for (const DataItem& item : catalogue()) {
    EXPECT_TRUE(statistics.count(item.statistic)) << item.id;
    if (std::regex_match(item.type, std::regex("[a-ln-z][a-z]*:[A-Z_0-9]+"))) {
      EXPECT_EQ(item.category == Category::sample, !item.units.empty()) << item.id;
    } else if (item.category == Category::sample) {
      ASSERT_TRUE(units.count(item.type)) << item.id;
      EXPECT_EQ(item.units, units.at(item.type)) << item.id;
    } else {
      EXPECT_TRUE((item.category == Category::event ? events : conditions).count(item.type)) << item.id;
      EXPECT_EQ(item.units, "") << item.id;
    }
  }
}

// Written by rosrun smartmill_exchange item_documents docs/exchange.md
// smartmill_exchange/schema/observation.json
TEST(Catalogue, TableAndSchemaAreThoseOfTheFiles) {
  const std::string document = readText(SOURCE_FOLDER "/../docs/exchange.md");
  EXPECT_EQ(withItemTable(document), document);
  EXPECT_EQ(observationSchema(), readText(SOURCE_FOLDER "/schema/observation.json"));
  EXPECT_THROW(withItemTable("no table"), Error);
}

}  // namespace
}  // namespace smartmill::exchange
