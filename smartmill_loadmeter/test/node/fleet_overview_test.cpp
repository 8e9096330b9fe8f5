#include "node/fleet_overview.h"

#include <unistd.h>

#include <cmath>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "node/fleet_message.h"
#include "node/fleet_pusher.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_loadmeter_testing/private_server.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

CoefficientRecord recordOf(const std::string& machine, const std::string& material, double ktc,
                           double stamp) {
  CoefficientRecord r;
  r.set.tool = "endmill 12";
  r.set.material = material;
  r.set.source = "load_meter";
  r.set.stamp = stamp;
  r.set.tests = 3;
  r.set.value = r.set.std_dev = NOT_IDENTIFIED;
  r.set.value.ktc = ktc;
  r.set.std_dev.ktc = 0.005 * ktc;
  r.machine = machine;
  return r;
}

FleetMember memberOf(const std::string& name, const std::string& login) {
  FleetMember m;
  m.name = name;
  m.login = login;
  m.shop = "milling";
  return m;
}

/// Ten machines that agree within a percent, and an outlier by 30 %; "new" has cut no steel yet.
std::vector<CoefficientRecord> shop() {
  std::vector<CoefficientRecord> records;
  for (int m = 0; m < 11; ++m)
    for (int cut = 0; cut < 6; ++cut) {
      const bool steel = cut % 2 == 0;
      if (m == 9 && steel) continue;
      const double bias = m == 10 ? 1.3 : 1.0 + 0.01 * std::sin(m + 0.4 * cut);
      const std::string name = m == 10 ? "odd" : m == 9 ? "new" : "mill " + std::to_string(m);
      records.push_back(recordOf(name, steel ? "steel" : "aluminium", (steel ? 1800e6 : 700e6) * bias,
                                 1.7e9 + 86400.0 * cut));
    }
  return records;
}

TEST(FleetOverviewTest, listsRecordsOutliersAndPredictedCuts) {
  std::vector<FleetMember> members{memberOf("new", "mill_09"), memberOf("odd", "mill_10"),
                                   memberOf("silent", "mill_11")};
  members[0].records = 3;
  members[0].behind = 2;
  members[0].silent = 60.0;
  const FleetOverview overview = fleetOverview(members, shop(), "mill_09");
  ASSERT_EQ(overview.pairs.size(), 2u);
  EXPECT_EQ(overview.pairs[0].material, "aluminium");
  EXPECT_EQ(overview.pairs[0].records, 33u);
  EXPECT_EQ(overview.pairs[0].own, 3u);
  EXPECT_EQ(overview.pairs[1].material, "steel");
  EXPECT_EQ(overview.pairs[1].own, 0u);
  // Nine machines have 1800 within a percent: so does the prediction for the tenth, which is new to the
  // material.
  EXPECT_NEAR(overview.pairs[1].ktc, 1800e6, 0.02 * 1800e6);
  EXPECT_LT(overview.pairs[1].ktc_std, 0.05 * 1800e6);
  EXPECT_LT(std::abs(overview.pairs[1].ktc - 1800e6), 3.0 * overview.pairs[1].ktc_std);

  ASSERT_EQ(overview.machines.size(), 12u);
  int outlier = 0;
  for (const FleetMachine& m : overview.machines) {
    EXPECT_EQ(m.here, m.member.name == "new");
    if (m.member.name == "odd") {
      EXPECT_GT(m.outlier, 0.9);
      EXPECT_NEAR(m.effect, std::log(1.3), 0.03);
      EXPECT_THAT(m.meaning, HasSubstr("constant in all cuts"));
    } else if (m.member.name == "silent") {
      EXPECT_THAT(m.records_by_pair, ElementsAre(0u, 0u));
      EXPECT_TRUE(std::isnan(m.outlier));
    } else {
      EXPECT_LT(m.outlier, 0.1) << m.member.name;
      EXPECT_TRUE(m.meaning.empty());
    }
    outlier += m.outlier > 0.5;
    if (m.member.name == "new") {
      EXPECT_THAT(m.records_by_pair, ElementsAre(3u, 0u));
    }
  }
  EXPECT_EQ(outlier, 1);
}

TEST(FleetOverviewTest, isEmptyWithoutRecords) {
  const FleetOverview overview = fleetOverview({memberOf("a", "a")}, {}, "a");
  EXPECT_TRUE(overview.pairs.empty());
  ASSERT_EQ(overview.machines.size(), 1u);
  EXPECT_TRUE(std::isnan(overview.machines[0].effect));
  EXPECT_TRUE(std::isnan(overview.deviations.machine));
}

TEST(FleetOverviewTest, aRecordWithALoginBelongsToItsMember) {
  const FleetOverview overview = fleetOverview({memberOf("mill 07", "mill_07")},
                                               {recordOf("mill_07", "steel", 1.8e9, 1.7e9)}, "mill_07");
  ASSERT_EQ(overview.machines.size(), 1u);
  EXPECT_THAT(overview.machines[0].records_by_pair, ElementsAre(1u));
  EXPECT_EQ(overview.pairs[0].own, 1u);
}

TEST(FleetOverviewTest, aLoginIsReadFromItsAddress) {
  EXPECT_EQ(loginOf("postgresql://mill_07@shop.local/fleet"), "mill_07");
  EXPECT_EQ(loginOf("postgresql://mill_07:word@shop.local:5432/fleet"), "mill_07");
  EXPECT_EQ(loginOf("postgresql:///fleet?user=mill_07&host=/tmp"), "mill_07");
  EXPECT_EQ(loginOf("postgresql://shop.local/fleet"), "");
}

/// Server with two machines.
class FleetMessage : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fleetSupported() || !PrivateServer::available()) GTEST_SKIP() << "requires ./setup --with-fleet";
    server_ = std::make_unique<PrivateServer>();
    migrateFleet(server_->url("owner"));
    for (const char* name : {"a", "b"}) enrol(server_->url("owner"), memberOf(name, name), "");
    FleetMember locked = memberOf("locked", "locked");
    enrol(server_->url("owner"), locked, "right");
  }
  /// First message that satisfies a condition.
  template <class Condition>
  smartmill_msgs::FleetState await(const FleetPusher& pusher, const std::string& url,
                                   const Condition& condition) {
    smartmill_msgs::FleetState message;
    for (int tries = 0; tries < 1200; ++tries) {
      message = toMsg(pusher.state(), url);
      if (pusher.state().tries > 0 && condition(message)) break;
      usleep(50000);
    }
    return message;
  }

  std::unique_ptr<PrivateServer> server_;
  TemporaryFolder folder_;
};

TEST_F(FleetMessage, listsAllMachinesAlsoWhileTheServerIsUnreachable) {
  CoefficientDatabase a(folder_.file("a.sqlite")), b(folder_.file("b.sqlite"));
  b.add(recordOf("b", "steel", 1810e6, 1.7e9));
  b.add(recordOf("b", "steel", 1790e6, 1.7e9 + 60.0));
  push(b, server_->url("b"));
  a.add(recordOf("a", "steel", 1800e6, 1.7e9));
  const std::string url = server_->url("a");
  FleetPusher pusher(folder_.file("a.sqlite"), url, 0.05);
  const auto whole = [](const auto& m) {
    return m.reached && m.pairs.size() == 1 && m.pairs[0].records == 3;
  };
  auto message = await(pusher, url, whole);
  ASSERT_EQ(message.pairs.size(), 1u) << message.message;
  EXPECT_EQ(message.pairs[0].own, 1u);
  EXPECT_NEAR(message.pairs[0].ktc, 1800e6, 40e6);
  ASSERT_EQ(message.machines.size(), 3u);
  EXPECT_EQ(message.machines[0].name, "a");
  EXPECT_TRUE(message.machines[0].here);
  EXPECT_EQ(message.machines[1].records, 2u);
  EXPECT_THAT(message.machines[1].knows, ElementsAre(2u));
  EXPECT_LT(message.machines[1].silent, 600.0);
  EXPECT_TRUE(std::isnan(message.machines[2].silent)) << "no push of this machine";
  EXPECT_EQ(a.size(), 1u) << "the machine's own file is unchanged";

  server_->stop();
  message = await(pusher, url, [](const auto& m) { return !m.reached; });
  EXPECT_FALSE(message.reached);
  EXPECT_THAT(message.message, AllOf(HasSubstr(message.server + ": "), Not(HasSubstr("\n"))));
  EXPECT_EQ(message.machines.size(), 3u) << "the last overview remains";
  server_->start();
  b.add(recordOf("b", "aluminium", 700e6, 1.7e9));
  push(b, server_->url("b"));
  message = await(pusher, url, [](const auto& m) { return m.pairs.size() == 2; });
  EXPECT_EQ(message.pairs.size(), 2u);
}

TEST_F(FleetMessage, wrongPasswordsAndAddressesGiveOneLineWithoutThePassword) {
  const std::string file = folder_.file("a.sqlite");
  CoefficientDatabase(file).add(recordOf("locked", "steel", 1800e6, 1.7e9));
  const struct {
    std::string url, expected;
  } cases[] = {{server_->url("locked", "secret_word"), "password authentication failed"},
               {server_->url("stranger"), "role \"stranger\" does not exist"},
               {server_->url("a", "", "nowhere"), "database \"nowhere\" does not exist"},
               {"postgresql://a@/postgres?host=/tmp/nowhere", "/tmp/nowhere"}};
  for (const auto& c : cases) {
    const FleetPusher pusher(file, c.url, 60.0);
    const auto message = await(pusher, c.url, [](const auto&) { return true; });
    EXPECT_FALSE(message.reached);
    EXPECT_THAT(message.message,
                AllOf(HasSubstr(c.expected), Not(HasSubstr("\n")), Not(HasSubstr("secret_word"))));
    EXPECT_THAT(message.server, Not(HasSubstr("secret_word")));
    EXPECT_EQ(message.behind, 1u);
    EXPECT_TRUE(message.machines.empty());
  }
}

}  // namespace
}  // namespace smartmill::loadmeter
