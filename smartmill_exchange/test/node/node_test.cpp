// exchange_node with a graph (node_test.py, run once for all cases), and its parameters.
#include <cstdlib>
#include <filesystem>
#include <iostream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "node/parameters.h"
#include "smartmill_core/io/text_file.h"

namespace smartmill::exchange {
namespace {

TEST(Parameters, ShippedFileMatchesTheTable) {
  ExchangeParameters parameters;
  EXPECT_EQ(tableOf(parameters).yaml(), readText(SOURCE_FOLDER "/../launch/config/exchange.yaml"));
  EXPECT_NO_THROW(parameters.validate());
}

class NodeTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (!results_.is_null() || !failure_.empty()) return;  // of another suite
    const std::string out = OUT;
    std::filesystem::remove_all(out);
    std::filesystem::create_directories(out);
    const int code = std::system(("timeout 300 /usr/bin/python3 " SOURCE_FOLDER
                                  "/test/node/node_test.py " EXCHANGE_NODE " " +
                                  out + " >" + out + "/script.txt 2>&1")
                                     .c_str());
    const std::string script = readText(out + "/script.txt");
    std::cout << script;
    const bool written = std::filesystem::exists(out + "/results.json");
    if (code == 0 && written) {
      results_ = nlohmann::json::parse(readText(out + "/results.json"));
    } else {
      failure_ = script + readText(out + "/log.txt");
    }
  }
  static void check(const std::string& name) {
    ASSERT_TRUE(failure_.empty()) << failure_;
    ASSERT_TRUE(results_.contains(name)) << results_.dump();
    const std::string result = results_[name].get<std::string>();
    if (result.rfind("skipped: ", 0) == 0) GTEST_SKIP() << result.substr(9);
    EXPECT_EQ(result, "");
  }

  static nlohmann::json results_;
  static std::string failure_;
};

nlohmann::json NodeTest::results_;
std::string NodeTest::failure_;

TEST_F(NodeTest, ValuesAreTheTopics) {
  check("ValuesAreTheTopics");
}
TEST_F(NodeTest, AssetsHaveTheirDeviations) {
  check("AssetsHaveTheirDeviations");
}
TEST_F(NodeTest, AStreamHasEveryValueOfTheTopic) {
  check("AStreamHasEveryValueOfTheTopic");
}
TEST_F(NodeTest, SilentTopicsBecomeUnavailable) {
  check("SilentTopicsBecomeUnavailable");
}
TEST_F(NodeTest, NothingFromOutsideReachesTheGraph) {
  check("NothingFromOutsideReachesTheGraph");
}
class OpcUaNodeTest : public NodeTest {};
TEST_F(OpcUaNodeTest, HasTheValuesOfTheTopics) {
  check("OpcUaHasTheValuesOfTheTopics");
}
TEST_F(NodeTest, AKilledNodeLeavesItsLastWill) {
  check("AKilledNodeLeavesItsLastWill");
}
TEST_F(NodeTest, ARemoteBrokerWithoutTlsIsRefused) {
  check("ARemoteBrokerWithoutTlsIsRefused");
}

}  // namespace
}  // namespace smartmill::exchange
