#include "smartmill_loadmeter/database/fleet.h"

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <memory>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "node/fleet_pusher.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/inspection_feature.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_loadmeter_testing/private_server.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

CoefficientRecord recordOf(const std::string& machine, int number) {
  CoefficientRecord r;
  r.set.tool = number % 2 ? "endmill 12" : "endmill\t\"16\" \\N";
  r.set.material = "1018";
  r.set.source = "load_meter";
  r.set.stamp = 1700000000.0 + number / 3.0;
  r.set.tests = 3;
  r.set.value = {950e6 + number / 7.0, NAN, NAN, 17e3, NAN, NAN};
  r.set.std_dev = {2e6, NAN, NAN, 100, NAN, NAN};
  r.machine = machine;
  r.cutting_speed = 0.5 + 0.01 * number;
  r.covariance[CoefficientRecord::covarianceIndex(0, 3)] = -1.0 / 3.0;
  r.bag = "night\nshift\r.bag";
  return r;
}

ModelImprovement improvementOf(const std::string& machine, int number) {
  ModelImprovement i;
  i.machine = machine;
  i.verdict = "explained";
  i.effects = "[{\"name\":\"runout\",\"at\":\"a\\\\b\\tc\"}]";
  i.rivals = i.resembles = i.tests = "[]";
  i.report = "/shop/\t" + std::to_string(number);
  i.stamp = 1700000000.0 + number;
  i.fit_before = 10.0 + number / 3.0;
  i.fit_after = 1.0;
  return i;
}

InspectionRecord inspectionOf(const std::string& machine) {
  InspectionRecord r;
  r.machine = machine;
  r.tool = "endmill";
  r.condition = "slot_1";
  r.kind = SLOT_WIDTH;
  r.direction = "y";
  r.stamp = 5.0;
  r.diameter = r.nominal = 0.012;
  r.measured = 0.011984;
  r.std_dev = 1.5e-6;
  return r;
}

HealthRecord healthOf(const std::string& machine, int number) {
  HealthRecord r;
  r.machine = machine;
  r.measured = "tool x";
  r.quantity = "damping of the mode at 930 Hz";
  r.bag = "a.bag";
  r.stamp = 1700000000.0 + number;
  r.first = 0.02;
  r.now = 0.02 + number / 700.0;
  r.drifted = 1.0;
  return r;
}

void fill(CoefficientDatabase& database, const std::string& machine, int first, int count) {
  std::vector<CoefficientRecord> records;
  for (int i = 0; i < count; ++i) records.push_back(recordOf(machine, first + i));
  database.add(records);
}

/// Server with three machines: a and b of one shop, c of another.
class FleetDatabase : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (fleetSupported() && PrivateServer::available()) server_ = std::make_unique<PrivateServer>();
  }
  static void TearDownTestSuite() { server_.reset(); }

  void SetUp() override {
    if (!server_) GTEST_SKIP() << "requires ./setup --with-fleet";
    static int count = 0;
    database_ = "fleet_" + std::to_string(++count);
    server_->makeDatabase(database_);
    migrateFleet(url("owner"));
    for (const char* name : {"a", "b"}) enrolAs(name, "milling");
    enrolAs("c", "turning");
  }
  void enrolAs(const std::string& name, const std::string& shop, const std::string& password = "") {
    FleetMember member;
    member.name = "machine " + name;
    member.login = name;
    member.shop = shop;
    enrol(url("owner"), member, password);
  }
  std::string url(const std::string& login, const std::string& password = "") const {
    return server_->url(login, password, database_);
  }
  std::string file(const std::string& name) const { return folder_.file(name + ".sqlite"); }

  static std::unique_ptr<PrivateServer> server_;
  TemporaryFolder folder_;
  std::string database_;
};

std::unique_ptr<PrivateServer> FleetDatabase::server_;

TEST_F(FleetDatabase, pushesNewRecordsAndPullsThemExactly) {
  CoefficientDatabase a(file("a")), b(file("b"));
  fill(a, "a", 0, 5000);
  fill(b, "b", 0, 10);
  const FleetTransfer first = push(a, url("a"));
  EXPECT_EQ(first.offered, 5000u);
  EXPECT_EQ(first.fresh, 5000u);
  EXPECT_EQ(push(a, url("a")).offered, 0u) << "acknowledged records are noted";
  EXPECT_EQ(push(a, url("a"), {}, true).fresh, 0u) << "a record is stored once";
  fill(a, "a", 5000, 1);
  EXPECT_EQ(a.synchronisation().behind(), 1u);
  EXPECT_EQ(push(a, url("a")).fresh, 1u);

  EXPECT_EQ(push(b, url("b")).fresh, 10u);
  EXPECT_EQ(pull(b, url("b")).fresh, 5001u);
  EXPECT_EQ(pull(b, url("b")).offered, 0u);
  EXPECT_EQ(push(b, url("b")).offered, 0u) << "records of the fleet are not sent back";
  EXPECT_EQ(b.size(), 5011u);
  for (const CoefficientRecord& r : b.records("", "")) {
    if (r.machine != "a") continue;
    const int number = static_cast<int>(std::lround(3.0 * (r.set.stamp - 1700000000.0)));
    const CoefficientRecord expected = recordOf("a", number);
    ASSERT_EQ(r.set.stamp, expected.set.stamp);
    ASSERT_EQ(r.set.value.ktc, expected.set.value.ktc);
    ASSERT_EQ(r.set.tool, expected.set.tool);
    ASSERT_EQ(r.bag, expected.bag);
    ASSERT_EQ(r.covariance[3], -1.0 / 3.0);
    ASSERT_TRUE(std::isnan(r.set.value.krc));
  }
}

TEST_F(FleetDatabase, pullKeepsUnsentRecords) {
  CoefficientDatabase a(file("a")), b(file("b"));
  fill(a, "a", 0, 20);
  push(a, url("a"));
  fill(b, "b", 0, 7);
  EXPECT_EQ(pull(b, url("b")).fresh, 20u);
  EXPECT_EQ(push(b, url("b")).fresh, 7u);
}

TEST_F(FleetDatabase, answersAsTheFileDoes) {
  CoefficientDatabase a(file("a"));
  fill(a, "a", 0, 3000);
  push(a, url("a"));
  const CoefficientDatabase fleet(url("b"));
  EXPECT_EQ(fleet.size(), 3000u);
  EXPECT_EQ(fleet.contents(), a.contents());
  EXPECT_EQ(fleet.find("endmill 12", "1018")->value.ktc, a.find("endmill 12", "1018")->value.ktc);
  EXPECT_FALSE(fleet.find("endmill 12", "titanium"));
  EXPECT_EQ(fleet.records("endmill 12", "1018").size(), a.records("endmill 12", "1018").size());
  for (const double speed : {0.7, 3.0, 29.0, 0.0}) {
    for (const char* tool : {"endmill 12", "unknown", ""}) {
      const CoefficientQuery query{tool, "1018", speed};
      const auto there = fleet.estimate(query), here = a.estimate(query);
      ASSERT_TRUE(there && here);
      EXPECT_EQ(there->records, here->records);
      EXPECT_EQ(there->other_tool, here->other_tool);
      EXPECT_NEAR(there->set.value.ktc, here->set.value.ktc, 1e-12 * here->set.value.ktc);
      EXPECT_NEAR(there->set.std_dev.ktc, here->set.std_dev.ktc, 1e-9 * here->set.std_dev.ktc);
    }
  }
}

TEST_F(FleetDatabase, aShopSeesOnlyItsOwn) {
  CoefficientDatabase a(file("a")), c(file("c"));
  fill(a, "a", 0, 50);
  fill(c, "c", 0, 5);
  push(a, url("a"));
  push(c, url("c"));
  EXPECT_EQ(CoefficientDatabase(url("a")).size(), 50u);
  EXPECT_EQ(CoefficientDatabase(url("c")).size(), 5u);
  EXPECT_EQ(pull(c, url("c")).offered, 0u);
  const std::vector<FleetMember> visible = fleetMembers(url("a"));
  ASSERT_EQ(visible.size(), 2u);
  EXPECT_EQ(visible[0].name, "machine a");
  EXPECT_EQ(visible[0].records, 50u);
  EXPECT_LT(visible[0].silent, 60.0);
  EXPECT_TRUE(std::isnan(visible[1].silent));
  // Another shop's file with the same records counts once in each shop.
  EXPECT_EQ(CoefficientDatabase(url("c")).merge(file("a")), 50u);
}

TEST_F(FleetDatabase, refusesDuplicateNamesAndUnknownLogins) {
  EXPECT_THAT(errorOf([&] { enrolAs("a", "turning"); }),
              HasSubstr("is enrolled with another name, login or shop"));
  EXPECT_THAT(errorOf([&] { CoefficientDatabase(url("owner")).add(recordOf("x", 1)); }),
              HasSubstr("not a machine of the fleet"));
}

TEST_F(FleetDatabase, wrongAddressesAndPasswordsGiveOneLine) {
  CoefficientDatabase a(file("a"));
  fill(a, "a", 0, 3);
  EXPECT_THAT(errorOf([&] { push(a, "mysql://there"); }), HasSubstr("'mysql://there': expected a server"));
  EXPECT_THAT(errorOf([&] { push(a, "postgresql://a@/postgres?host=/tmp/nowhere"); }),
              HasSubstr("/tmp/nowhere"));
  EXPECT_THAT(errorOf([&] { push(a, url("stranger")); }), HasSubstr("role \"stranger\" does not exist"));
  enrolAs("locked", "milling", "right 'word'");
  const std::string wrong = errorOf([&] { push(a, url("locked", "secret_word")); });
  EXPECT_THAT(wrong, AllOf(HasSubstr("password authentication failed"), Not(HasSubstr("secret_word")),
                           Not(HasSubstr("\n"))));
  EXPECT_EQ(push(a, url("locked", "right%20'word'")).fresh, 3u) << "nothing was lost";
}

TEST_F(FleetDatabase, olderTablesAreNamedAndMigratedWithoutLoss) {
  server_->makeDatabase("old");
  const std::string old = server_->url("owner", "", "old");
  EXPECT_THAT(errorOf([&] { CoefficientDatabase database(old); }), HasSubstr("no tables"));
  EXPECT_EQ(migrateFleet(old, 1), 0);
  EXPECT_THAT(errorOf([&] { CoefficientDatabase database(old); }),
              HasSubstr("tables of version 1, expected 5: update them with `coefficients_db URL migrate`"));
  ASSERT_TRUE(server_->run("owner", "old",
                           "INSERT INTO machine (name, login, shop) VALUES ('a', 'owner', 'milling')"));
  ASSERT_TRUE(server_->run("owner", "old",
                           "INSERT INTO coefficients (identity, shop, machine_id, speed_bucket, tool, "
                           "material, source, machine, bag, version, "
                           "stamp, ktc) VALUES ('1', 'milling', 1, 0, 't', 'm', '', '', '', '', 5, 7e8)"));
  EXPECT_EQ(migrateFleet(old), 1);
  EXPECT_EQ(migrateFleet(old), 5) << "a repeated migration changes nothing";
  EXPECT_EQ(CoefficientDatabase(old).find("t", "m")->value.ktc, 7e8);
  ASSERT_TRUE(server_->run("owner", "old", "UPDATE fleet SET schema = 6"));
  EXPECT_THAT(errorOf([&] { CoefficientDatabase database(old); }), HasSubstr("newer than this program's 5"));
}

// A server of version 2, without improvements and health: a machine that pushed then continues.
TEST_F(FleetDatabase, tablesOfVersionTwoTakeTheNewKindsAfterMigration) {
  server_->makeDatabase("second");
  const auto there = [&](const std::string& login) { return server_->url(login, "", "second"); };
  EXPECT_EQ(migrateFleet(there("owner"), 2), 0);
  ASSERT_TRUE(server_->run("owner", "second",
                           "INSERT INTO machine (name, login, shop) VALUES ('machine a', 'a', 'milling')"));
  ASSERT_TRUE(server_->run("a", "second",
                           "INSERT INTO coefficients (identity, shop, machine_id, speed_bucket, tool, "
                           "material, source, machine, bag, version, stamp, ktc) VALUES ('1', 'milling', 1, "
                           "0, 't', 'm', '', '', '', '', 5, 7e8)"));
  ASSERT_TRUE(server_->run("a", "second",
                           "INSERT INTO push (shop, machine_id, offered, fresh, behind) VALUES ('milling', "
                           "1, 1, 1, 0)"));
  CoefficientDatabase a(file("a"));
  a.evidence().add(std::vector<HealthRecord>{healthOf("a", 1)});
  EXPECT_THAT(errorOf([&] { push(a, there("a")); }), HasSubstr("tables of version 2, expected 5"));
  EXPECT_EQ(migrateFleet(there("owner")), 2);
  EXPECT_EQ(push(a, there("a")).fresh, 1u);
  EXPECT_EQ(CoefficientDatabase(there("a")).find("t", "m")->value.ktc, 7e8);
  EXPECT_EQ(CoefficientDatabase(there("a")).evidence().health().size(), 1u);
  EXPECT_EQ(fleetMembers(there("a")).at(0).records, 2u);
}

TEST_F(FleetDatabase, everyKindOfRecordIsTransferred) {
  CoefficientDatabase a(file("a")), b(file("b"));
  CoefficientRecord cut = recordOf("a", 7);
  cut.set.source = SOURCE_PRODUCTION;
  a.add(cut);
  a.evidence().add(std::vector<ModelImprovement>{improvementOf("a", 1), improvementOf("a", 2)});
  a.evidence().add(std::vector<HealthRecord>{healthOf("a", 1), healthOf("a", 2), healthOf("a", 3)});
  EXPECT_EQ(a.evidence().add(std::vector<HealthRecord>{healthOf("a", 3)}), 0u)
      << "an existing record is not added";
  a.evidence().add(std::vector<InspectionRecord>{inspectionOf("a")});
  EXPECT_EQ(push(a, url("a")).fresh, 7u);
  EXPECT_EQ(push(a, url("a")).offered, 0u);
  EXPECT_EQ(push(a, url("a"), {}, true).fresh, 0u);
  b.evidence().add(std::vector<HealthRecord>{healthOf("b", 1)});
  EXPECT_EQ(pull(b, url("b")).fresh, 7u);
  EXPECT_EQ(pull(b, url("b")).offered, 0u);
  EXPECT_EQ(b.evidence().inspections("endmill").at(0).measured, 0.011984);
  EXPECT_EQ(push(b, url("b")).fresh, 1u) << "its own record was not sent yet";
  EXPECT_EQ(b.synchronisation().behind(), 0u);
  EXPECT_EQ(b.records("", "").at(0).set.source, SOURCE_PRODUCTION);
  const ModelImprovement received = b.evidence().improvements().at(1), expected = improvementOf("a", 2);
  EXPECT_EQ(received.effects, expected.effects);
  EXPECT_EQ(received.fit_before, expected.fit_before);
  EXPECT_TRUE(std::isnan(received.heldout_before));
  EXPECT_EQ(received.report, expected.report);
  const HealthRecord health = b.evidence().health().at(3), sent = healthOf("a", 3);
  EXPECT_EQ(health.quantity, sent.quantity);
  EXPECT_EQ(health.now, sent.now);
  EXPECT_EQ(CoefficientDatabase(url("b")).evidence().health().size(), 4u);
  EXPECT_EQ(CoefficientDatabase(url("c")).evidence().health().size(), 0u) << "another shop";
  EXPECT_EQ(CoefficientDatabase(url("c")).evidence().improvements().size(), 0u);
}

TEST_F(FleetDatabase, recordsOfEveryKindAreBoundToTheirSender) {
  CoefficientDatabase a(file("a"));
  a.evidence().add(std::vector<ModelImprovement>{improvementOf("a", 1)});
  a.evidence().add(std::vector<HealthRecord>{healthOf("a", 1)});
  a.evidence().add(std::vector<InspectionRecord>{inspectionOf("a")});
  push(a, url("a"));
  const std::pair<std::string, std::string> kinds[] = {
      {"improvements", "machine, verdict, effects, rivals, resembles, tests, asked, report, version"},
      {"health", "machine, measured, quantity, bag, version"},
      {"inspections", "machine, tool, material, condition, kind, direction, bag, version"}};
  for (const auto& [table, words] : kinds) {
    const auto forge = [&](const std::string& machine, const std::string& shop) {
      std::string values = "'x" + machine + "', '" + shop + "', " + machine;
      for (std::size_t i = 0; i <= static_cast<std::size_t>(std::count(words.begin(), words.end(), ',')); ++i)
        values += ", ''";
      return server_->run(
          "b", database_,
          "INSERT INTO " + table + " (identity, shop, machine_id, " + words + ") VALUES (" + values + ")");
    };
    EXPECT_FALSE(forge("1", "milling")) << table << ": machine a's";
    EXPECT_FALSE(forge("2", "turning")) << table << ": another shop's";
    EXPECT_TRUE(forge("2", "milling")) << table << ": its own";
    EXPECT_FALSE(server_->run("b", database_, "UPDATE " + table + " SET stamp = 1"));
    EXPECT_FALSE(server_->run("b", database_, "DELETE FROM " + table));
  }
}

TEST_F(FleetDatabase, rowsOfOthersCanBeNeitherForgedNorChanged) {
  CoefficientDatabase a(file("a"));
  fill(a, "a", 0, 3);
  push(a, url("a"));
  const auto done = [&](const std::string& sql) { return server_->run("b", database_, sql); };
  const std::string values =
      "INSERT INTO coefficients (identity, shop, machine_id, speed_bucket, tool, material, source, machine, "
      "bag, version) "
      "VALUES ('x', 'milling', ";
  EXPECT_FALSE(done(values + "1, 0, '', '', '', '', '', '')")) << "machine a's";
  EXPECT_TRUE(done(values + "2, 0, '', '', '', '', '', '')")) << "its own";
  EXPECT_FALSE(done("UPDATE coefficients SET ktc = 1"));
  EXPECT_FALSE(done("DELETE FROM coefficients"));
  EXPECT_FALSE(done("UPDATE fleet SET schema = 1"));
}

TEST_F(FleetDatabase, aClientKilledDuringAPushLosesNothing) {
  {
    CoefficientDatabase a(file("a"));
    fill(a, "a", 0, 9000);
  }
  const pid_t client = fork();
  if (client == 0) {
    CoefficientDatabase a(file("a"));
    push(a, url("a"), [](const FleetTransfer&) { raise(SIGKILL); });
    _exit(1);
  }
  int status = 0;
  waitpid(client, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  CoefficientDatabase a(file("a"));
  EXPECT_EQ(CoefficientDatabase(url("a")).size(), 2000u) << "one batch was acknowledged";
  EXPECT_EQ(push(a, url("a")).fresh, 7000u);
  EXPECT_EQ(CoefficientDatabase(url("a")).size(), 9000u);
}

TEST_F(FleetDatabase, aServerKilledDuringAPushLosesNothing) {
  CoefficientDatabase a(file("a"));
  fill(a, "a", 0, 6000);
  std::size_t acknowledged = 0;
  const std::string message = errorOf([&] {
    push(a, url("a"), [&](const FleetTransfer& done) {
      acknowledged = done.offered;
      server_->kill();
      usleep(200000);
    });
  });
  EXPECT_THAT(message, Not(HasSubstr("\n")));
  EXPECT_EQ(a.synchronisation().behind(), message.empty() ? 0u : 6000u - acknowledged);
  server_->start();
  push(a, url("a"));
  EXPECT_EQ(CoefficientDatabase(url("a")).size(), 6000u);
}

TEST_F(FleetDatabase, twoClientsWithTheSameRecordsStoreThemOnce) {
  for (const char* name : {"a", "b"}) {
    CoefficientDatabase database(file(name));
    fill(database, "a", 0, 4000);
  }
  FleetTransfer by_a, by_b;
  std::thread other([&] {
    CoefficientDatabase b(file("b"));
    by_b = push(b, url("b"));
  });
  CoefficientDatabase a(file("a"));
  by_a = push(a, url("a"));
  other.join();
  EXPECT_EQ(by_a.fresh + by_b.fresh, 4000u);
  EXPECT_EQ(CoefficientDatabase(url("a")).size(), 4000u);
}

TEST_F(FleetDatabase, theNodesPusherReportsUnsentRecordsAndCatchesUp) {
  CoefficientDatabase a(file("a"));
  fill(a, "a", 0, 5);
  server_->stop();
  FleetPusher pusher(file("a"), url("a"), 0.05);
  const auto wait = [&](bool failing, std::size_t behind) {
    FleetPusher::State state;
    for (int tries = 0; tries < 1200; ++tries) {
      state = pusher.state();
      if (state.failing == failing && state.behind == behind) break;
      usleep(50000);
    }
    return state;
  };
  const FleetPusher::State away = wait(true, 5);
  EXPECT_EQ(away.behind, 5u);
  EXPECT_THAT(away.message, AllOf(HasSubstr("connection to server"), Not(HasSubstr("\n"))));
  server_->start();
  EXPECT_FALSE(wait(false, 0).failing);
  EXPECT_EQ(CoefficientDatabase(url("b")).size(), 5u);
  fill(a, "a", 5, 1);
  for (int tries = 0; tries < 1200 && CoefficientDatabase(url("b")).size() < 6; ++tries) usleep(50000);
  EXPECT_EQ(CoefficientDatabase(url("b")).size(), 6u);
}

TEST(Fleet, addressesAreDisplayedWithoutTheirPassword) {
  EXPECT_EQ(withoutPassword("postgresql://mill:secret@shop.local:5432/fleet"),
            "postgresql://mill@shop.local:5432/fleet");
  EXPECT_EQ(withoutPassword("postgresql://mill@shop.local:5432/fleet"),
            "postgresql://mill@shop.local:5432/fleet");
  EXPECT_EQ(withoutPassword("postgresql://shop.local:5432/fleet"), "postgresql://shop.local:5432/fleet");
  EXPECT_EQ(withoutPassword("postgresql:///fleet?user=mill&password=secret&host=/tmp"),
            "postgresql:///fleet?user=mill&password=&host=/tmp");
  EXPECT_TRUE(isServerUrl("postgresql:///fleet"));
  EXPECT_FALSE(isServerUrl("machine.sqlite"));
}

TEST(Fleet, aBuildWithoutLibpqNamesTheOption) {
  if (fleetSupported()) return;
  const TemporaryFolder folder;
  CoefficientDatabase local(folder.file("a.sqlite"));
  EXPECT_THAT(errorOf([&] { push(local, "postgresql://mill@shop.local/fleet"); }),
              HasSubstr("no libpq; install it with `./setup --with-fleet`"));
  EXPECT_THAT(errorOf([&] { CoefficientDatabase("postgresql://mill@shop.local/fleet"); }),
              HasSubstr("./setup"));
}

}  // namespace
}  // namespace smartmill::loadmeter
