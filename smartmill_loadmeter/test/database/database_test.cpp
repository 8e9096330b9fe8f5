#include "smartmill_loadmeter/database/database.h"

#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/inspection_feature.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_loadmeter/database/find_coefficients.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;

CoefficientSet setOf(const std::string& tool, const std::string& material, double stamp, double ktc) {
  CoefficientSet k;
  k.tool = tool;
  k.material = material;
  k.source = "load_meter";
  k.stamp = stamp;
  k.tests = 3;
  k.value = {ktc, NAN, NAN, 17e3, NAN, NAN};
  k.std_dev = {2e6, NAN, NAN, 100, NAN, NAN};
  k.friction_viscous = 4.7e-4;
  k.friction_coulomb = -0.06;
  return k;
}

CoefficientRecord recordOf(const std::string& tool, double stamp, double ktc, double cutting_speed) {
  CoefficientRecord r;
  r.set = setOf(tool, "1018", stamp, ktc);
  r.machine = "NMV-5000";
  r.teeth = 3;
  r.diameter = 0.012;
  r.helix = 0.6108652381980153;
  r.cutting_speed = cutting_speed;
  r.feed_per_tooth = 6.3e-5;
  r.covariance[CoefficientRecord::covarianceIndex(0, 0)] = 4e12;
  r.covariance[CoefficientRecord::covarianceIndex(0, 3)] = -1.0 / 3.0;
  r.bag = "night, \"shift\"\n2.bag";
  return r;
}

std::string contentOf(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(CoefficientDatabase, storesTheNewestOfEachToolAndMaterialInItsFile) {
  const TemporaryFolder folder;
  const std::string file = folder.file("machine.sqlite");
  {
    CoefficientDatabase database(file);
    EXPECT_FALSE(database.find("", ""));
    EXPECT_TRUE(database.add(setOf("endmill 12", "1018", 1700000000.123456789, 950e6)));
    EXPECT_TRUE(database.add(setOf("endmill 12", "1018", 1700000000.123456789, 960e6)));
    EXPECT_FALSE(database.add(setOf("endmill 12", "1018", 1700000000.123456789, 960e6)));
    EXPECT_TRUE(database.add(setOf("other", "1018", 1700000000.0, 960e6)));
  }
  const CoefficientDatabase database(file);
  const auto found = database.find("endmill 12", "1018");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->value.ktc, 960e6);
  EXPECT_EQ(found->std_dev.kte, 100.0);
  EXPECT_TRUE(std::isnan(found->value.krc));
  EXPECT_EQ(found->stamp, 1700000000.123456789);
  EXPECT_EQ(found->friction_coulomb, -0.06);
  EXPECT_EQ(found->tests, 3);
  EXPECT_FALSE(database.find("endmill 12", "steel"));
  EXPECT_EQ(database.contents(), "endmill 12 / 1018, other / 1018");
  EXPECT_FALSE(database.records("", "").front().version.empty());
}

TEST(CoefficientDatabase, withoutAFileStoresThisRun) {
  CoefficientDatabase database("");
  database.add(setOf("a", "b", 1.0, 1e9));
  EXPECT_EQ(database.size(), 1u);
}

TEST(CoefficientDatabase, refusesOtherFiles) {
  const TemporaryFolder folder;
  const std::string yaml = folder.write("m.yaml", "format: smartmill-coefficients/1\nentries: []\n");
  EXPECT_EQ(errorOf([&] { CoefficientDatabase{yaml}; }), yaml + ": file is not a database");
  EXPECT_THAT(errorOf([] { CoefficientDatabase("/nowhere/m.sqlite"); }), HasSubstr("/nowhere/m.sqlite: "));
  const std::string other = folder.file("other.sqlite");
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open(other.c_str(), &db), SQLITE_OK);
  sqlite3_exec(db, "CREATE TABLE songs (name TEXT)", nullptr, nullptr, nullptr);
  sqlite3_close(db);
  EXPECT_EQ(errorOf([&] { CoefficientDatabase{other}; }), other + ": not a database of cutting coefficients");
}

TEST(CoefficientDatabase, exportAndImportLoseNothing) {
  const TemporaryFolder folder;
  CoefficientDatabase database("");
  for (int i = 0; i < 5; ++i) {
    database.add(recordOf(i % 2 ? "a" : "b, long", 1000.0 + i / 3.0, 1e9 / 3.0 * (i + 1), 2.0 + i / 7.0));
  }
  CoefficientRecord bare;
  bare.set = setOf("c", "brass", 1.0, 5e8);
  database.add(bare);
  const auto all = database.records("", "");
  exportCsv(all, folder.file("a.csv"));
  exportYaml(all, folder.file("a.yaml"));
  CoefficientDatabase from_csv(""), from_yaml("");
  EXPECT_EQ(from_csv.add(importCsv(folder.file("a.csv"))), 6u);
  EXPECT_EQ(from_yaml.add(importYaml(folder.file("a.yaml"))), 6u);
  exportCsv(from_csv.records("", ""), folder.file("b.csv"));
  exportCsv(from_yaml.records("", ""), folder.file("c.csv"));
  EXPECT_EQ(contentOf(folder.file("a.csv")), contentOf(folder.file("b.csv")));
  EXPECT_EQ(contentOf(folder.file("a.csv")), contentOf(folder.file("c.csv")));
  // The same content is the same record, whatever its source.
  EXPECT_EQ(database.add(importYaml(folder.file("a.yaml"))), 0u);
}

TEST(CoefficientDatabase, importNamesWhatIsWrong) {
  const TemporaryFolder folder;
  const std::string file = folder.write("x.csv", "tool,ktc[N/m2]\na,1e9\nb,many\n");
  EXPECT_EQ(errorOf([&] { importCsv(file); }), file + ": line 3: column ktc[N/m2]: 'many' is not a number");
  const std::string unknown = folder.write("y.csv", "tool,ktc[N/mm2]\n");
  EXPECT_EQ(errorOf([&] { importCsv(unknown); }), unknown + ": line 1: column 'ktc[N/mm2]' is unknown");
  const std::string yaml = folder.write(
      "z.yaml", "format: smartmill-coefficients/1\nentries:\n- {source: force, stamp_s: 1.0, kct: 3.0}\n");
  EXPECT_THAT(errorOf([&] { importYaml(yaml); }), HasSubstr("kct"));
  // The earlier form in shop units.
  const auto old = importYaml(folder.write("old.yaml",
                                           "format: smartmill-coefficients/1\nentries:\n"
                                           "- {source: force, stamp_s: 1.0, tests: 2, cutting: "
                                           "{Ktc_n_per_mm2: 900.0, Ktc_n_per_mm2_std: 3.0}}\n"));
  ASSERT_EQ(old.size(), 1u);
  EXPECT_EQ(old[0].set.value.ktc, 900e6);
  EXPECT_EQ(old[0].set.std_dev.ktc, 3e6);
}

TEST(CoefficientDatabase, mergeAddsNewRecordsOnce) {
  const TemporaryFolder folder;
  CoefficientDatabase a(folder.file("a.sqlite"));
  {
    CoefficientDatabase b(folder.file("b.sqlite"));
    a.add(recordOf("t", 1.0, 1e9, 2.0));
    b.add(recordOf("t", 1.0, 1e9, 2.0));
    b.add(recordOf("t", 2.0, 1.1e9, 2.0));
  }
  EXPECT_EQ(a.merge(folder.file("b.sqlite")), 1u);
  EXPECT_EQ(a.merge(folder.file("b.sqlite")), 0u);
  EXPECT_EQ(a.size(), 2u);
  EXPECT_THAT(errorOf([&] { a.merge(folder.file("none.sqlite")); }),
              HasSubstr("none.sqlite: cannot be read"));
}

TEST(Estimate, uncertaintyGrowsWithDistance) {
  CoefficientDatabase database("");
  database.add(recordOf("t", 1.0, 1e9, 2.0));
  CoefficientQuery query;
  query.tool = "t";
  query.material = "1018";
  double before = 0.0;
  for (const double speed : {2.0, 3.0, 4.0, 8.0, 64.0}) {
    query.cutting_speed = speed;
    const auto found = database.estimate(query);
    ASSERT_TRUE(found);
    EXPECT_DOUBLE_EQ(found->set.value.ktc, 1e9);
    EXPECT_NEAR(found->nearest, std::log2(speed / 2.0), 1e-12);
    EXPECT_GT(found->set.std_dev.ktc, before);
    before = found->set.std_dev.ktc;
  }
  query.cutting_speed = 2.0;
  EXPECT_DOUBLE_EQ(database.estimate(query)->set.std_dev.ktc, 2e6);
  // Another tool in the same material is farther away, which the message states.
  query.tool = "new";
  const auto other = database.estimate(query);
  ASSERT_TRUE(other);
  EXPECT_TRUE(other->other_tool);
  EXPECT_GT(other->set.std_dev.ktc, 0.1e9);
  query.material = "titanium";
  EXPECT_FALSE(database.estimate(query));
  const FoundCoefficients found = findCoefficients(database, "new", "1018", {}, MachineModel());
  ASSERT_TRUE(found.predicted);
  EXPECT_THAT(found.message, HasSubstr("no records with 'new'"));
}

TEST(Estimate, nearRecordsCountMoreThanFarOnes) {
  CoefficientDatabase database("");
  for (int i = 0; i < 4; ++i) {
    database.add(recordOf("t", 1.0 + i, 1.0e9, 2.0));
    database.add(recordOf("t", 10.0 + i, 0.9e9, 8.0));
  }
  CoefficientQuery query{"t", "1018", 2.2};
  EXPECT_NEAR(database.estimate(query)->set.value.ktc, 1.0e9, 0.01e9);
  query.cutting_speed = 7.0;
  EXPECT_NEAR(database.estimate(query)->set.value.ktc, 0.9e9, 0.01e9);
}

// Ktc varies with cutting speed by a power law that the database does not model: its standard deviation must
// cover that.
TEST(Estimate, coversTheEffectOfCuttingSpeed) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> exponent(-0.12, 0.12), octave(-2.0, 2.0);
  int inside = 0;
  const int runs = 200;
  for (int run = 0; run < runs; ++run) {
    const double e = exponent(random);
    CoefficientDatabase database("");
    for (int i = 0; i < 3; ++i) {
      const double v = 2.0 * std::pow(2.0, 0.3 * i);
      database.add(recordOf("t", i, 1e9 * std::pow(v / 2.0, e) + 2e6 * normal(random), v));
    }
    CoefficientQuery query{"t", "1018", 2.0 * std::pow(2.0, octave(random))};
    const auto found = database.estimate(query);
    const double truth = 1e9 * std::pow(query.cutting_speed / 2.0, e);
    inside += std::abs(found->set.value.ktc - truth) < 1.96 * found->set.std_dev.ktc;
  }
  EXPECT_GE(inside, 0.9 * runs);
}

TEST(Database, hundredThousandRecordsAreLookedUpInUnderFiveMilliseconds) {
  CoefficientDatabase database("");  // same tables as a file (loadmeter_database lookup)
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform;
  std::vector<CoefficientRecord> many;
  for (int i = 0; i < 100000; ++i) {
    // Half of them one pair: the worst case of an index.
    const std::string tool = i % 2 ? "common" : "tool " + std::to_string(i % 200);
    many.push_back(recordOf(tool, i, 1e9 * (0.8 + 0.4 * uniform(random)), 0.5 + 10.0 * uniform(random)));
    many.back().bag.clear();
  }
  ASSERT_EQ(database.add(many), many.size());
  std::vector<double> times;
  for (int i = 0; i < 60; ++i) {
    CoefficientQuery query{i % 3 ? "common" : "tool 42", "1018", 0.5 + 10.0 * uniform(random), 6e-5};
    if (i % 5 == 0) query.tool = "unheard of";
    const auto begin = std::clock();  // CPU time, independent of other processes
    const auto estimate = database.estimate(query);
    const auto newest = database.find(query.tool == "unheard of" ? "" : query.tool, query.material);
    times.push_back(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    ASSERT_TRUE(estimate && newest);
  }
  std::sort(times.begin(), times.end());
  std::printf("estimate and find among 100000: median %.2f ms, slowest %.2f ms\n", 1e3 * times[30],
              1e3 * times.back());
  EXPECT_LT(times[30], 5e-3);
}

// A file of version 1 with records, one of them sent.
TEST(Database, anOlderFileIsUpdatedWithoutLoss) {
  const TemporaryFolder folder;
  const std::string file = folder.file("old.sqlite");
  {
    CoefficientDatabase made(file);
    made.add(std::vector<CoefficientRecord>{recordOf("t", 1, 1e9, 2.0), recordOf("t", 2, 1.1e9, 2.0)});
  }
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &db), SQLITE_OK);
  ASSERT_EQ(
      sqlite3_exec(db,
                   "ALTER TABLE coefficients DROP COLUMN first_stamp; ALTER TABLE coefficients DROP "
                   "COLUMN flank_wear; ALTER TABLE coefficients DROP COLUMN temperature;"
                   "DROP TABLE improvements; DROP TABLE health; DROP TABLE inspections; DROP TABLE handed; "
                   "CREATE TABLE sent "
                   "(fleet TEXT PRIMARY KEY, last INTEGER, at REAL); INSERT INTO sent VALUES ('f', 1, "
                   "1); PRAGMA user_version=1",
                   nullptr, nullptr, nullptr),
      SQLITE_OK);
  sqlite3_close(db);
  CoefficientDatabase database(file);
  EXPECT_EQ(database.size(), 2u);
  EXPECT_TRUE(std::isnan(database.records("t", "")[0].temperature));
  EXPECT_FALSE(database.add(recordOf("t", 1, 1e9, 2.0))) << "a record keeps its identity";
  EXPECT_EQ(database.synchronisation().lastFleet(), "f");
  EXPECT_EQ(database.synchronisation().unsentCount("f"), 1u);
  HealthRecord health;
  health.stamp = 5.0;
  EXPECT_EQ(database.evidence().add(std::vector<HealthRecord>{health}), 1u);
  EXPECT_EQ(database.synchronisation().unsentCount("f"), 2u);
  health.stamp = NAN;
  EXPECT_THAT(errorOf([&] { database.evidence().add(std::vector<HealthRecord>{health}); }),
              HasSubstr("old.sqlite: stamp of a record: expected a finite number"));
}

// A file of version 3 has no inspections; its other records stay.
TEST(Database, aFileOfVersionThreeTakesInspections) {
  const TemporaryFolder folder;
  const std::string file = folder.file("third.sqlite");
  CoefficientDatabase(file).add(recordOf("t", 1, 1e9, 2.0));
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &db), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(db, "DROP TABLE inspections; PRAGMA user_version=3", nullptr, nullptr, nullptr),
            SQLITE_OK);
  sqlite3_close(db);
  CoefficientDatabase database(file);
  EXPECT_EQ(database.size(), 1u);
  EXPECT_TRUE(database.evidence().inspections().empty());
  InspectionRecord slot;
  slot.stamp = 5.0;
  EXPECT_EQ(database.evidence().add(std::vector<InspectionRecord>{slot}), 1u);
}

// The same value of a cut is one record, whenever it was entered and whatever is known of the cut by then.
TEST(Database, inspectionsAreStoredOnce) {
  const TemporaryFolder folder;
  InspectionRecord slot;
  slot.machine = "mill 07";
  slot.tool = "endmill 12";
  slot.material = "6061";
  slot.condition = "slot_1";
  slot.kind = SLOT_WIDTH;
  slot.direction = "y";
  slot.stamp = 1700000100.5;
  slot.cut_time = 1700000000.25;
  slot.diameter = slot.nominal = 0.012;
  slot.measured = 0.011984;
  slot.std_dev = 1.5e-6;
  slot.deflection = -2.5e-6;
  slot.deflection_std = 3e-7;
  slot.machine_temperature = 313.15;
  slot.part_temperature = 295.15;
  slot.part_expansion = 23.1e-6;
  slot.edge_age = 240.0;
  InspectionRecord again = slot, other = slot;
  again.stamp += 60.0;
  again.deflection = NAN;
  other.measured = 0.011986;
  other.tool = "endmill 10";
  {
    const CoefficientDatabase database(folder.file("m.sqlite"));
    EXPECT_EQ(database.evidence().add(std::vector<InspectionRecord>{slot, again, other}), 2u);
  }
  const CoefficientDatabase database(folder.file("m.sqlite"));
  EXPECT_EQ(database.evidence().inspections().size(), 2u);
  const auto read = database.evidence().inspections("endmill 12");
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(read[0].machine, "mill 07");
  EXPECT_EQ(read[0].material, "6061");
  EXPECT_EQ(read[0].condition, "slot_1");
  EXPECT_EQ(read[0].kind, SLOT_WIDTH);
  EXPECT_EQ(read[0].direction, "y");
  EXPECT_EQ(read[0].stamp, 1700000100.5);
  EXPECT_EQ(read[0].cut_time, 1700000000.25);
  EXPECT_EQ(read[0].diameter, 0.012);
  EXPECT_EQ(read[0].measured, 0.011984);
  EXPECT_EQ(read[0].std_dev, 1.5e-6);
  EXPECT_EQ(read[0].deflection, -2.5e-6);
  EXPECT_EQ(read[0].deflection_std, 3e-7);
  EXPECT_EQ(read[0].machine_temperature, 313.15);
  EXPECT_EQ(read[0].edge_age, 240.0);
  EXPECT_FALSE(read[0].version.empty());
  // At 22 deg C 12 mm of aluminium are 0.55 um longer than at 20 deg C.
  EXPECT_NEAR(read[0].deviation(), -16e-6 - 0.55e-6, 5e-9);
  CoefficientDatabase copy("");
  copy.merge(folder.file("m.sqlite"));
  EXPECT_EQ(copy.evidence().inspections().size(), 2u);
}

// Without a value the fields of schema 3 do not change a record; with one it is another record.
TEST(Database, wearAndTemperatureAreStored) {
  const TemporaryFolder folder;
  CoefficientRecord warm = recordOf("t", 1, 1e9, 2.0);
  warm.first_stamp = 0.5, warm.flank_wear = 1.2e-4, warm.temperature = 313.15, warm.edge_age = 240.0;
  CoefficientDatabase database(folder.file("m.sqlite"));
  database.add(recordOf("t", 1, 1e9, 2.0));
  EXPECT_TRUE(database.add(warm));
  const CoefficientRecord read = database.records("t", "")[1];
  EXPECT_EQ(read.first_stamp, 0.5);
  EXPECT_EQ(read.flank_wear, 1.2e-4);
  EXPECT_EQ(read.temperature, 313.15);
  exportCsv({read}, folder.file("a.csv"));
  EXPECT_FALSE(database.add(importCsv(folder.file("a.csv"))[0]));
}

// Keys and numbers of docs/formats.md.
TEST(Database, aReportIsStoredOnceWithItsEvidence) {
  const TemporaryFolder folder;
  const std::string report = folder.write("report.json", R"({"format": "smartmill-report/1",
    "verdict": "explained", "effects": [{"name": "runout", "parameters": {"angle_deg": {"value": 261.8,
    "std": 0.01}, "offset_um": {"value": 21.08, "std": 0.004}}, "delta_bic": 2.69e8, "confidence": 0.99,
    "heldout_gap_reduction": 1.0, "alternatives": []}, {"name": "empirical", "stage": "sensor",
    "form": "tone", "parameters": {}, "delta_bic": 9.0, "confidence": 0.9}], "not_separable": [],
    "resembles": [], "suggested_test": null, "gap": {"before": {"fit": 42.5, "heldout": 57.4},
    "after": {"fit": 1.006, "heldout": 1.009}}, "gaps": [
    {"test": "air", "channel": "fx", "heldout": false, "before": 1.0, "after": 1.0},
    {"test": "slot", "channel": "fx", "heldout": false, "before": 50.0, "after": 1.0},
    {"test": "slot", "channel": "fy", "heldout": false, "before": 90.0, "after": 1.1}]})");
  ModelImprovement kept = readImprovement(report);
  kept.machine = "mill 07";
  const auto causes = causesOf(kept);
  ASSERT_EQ(causes.size(), 1u) << "an unnamed cause cannot be proposed";
  EXPECT_EQ(causes[0].text(), "runout: angle_deg 261.8 +- 0.01, offset_um 21.08 +- 0.004");
  EXPECT_EQ(evidenceOf(kept).at(1).test, "slot");
  EXPECT_EQ(evidenceOf(kept).at(1).gaps.at(1).channel, "fy");
  EXPECT_EQ(evidenceOf(kept).at(1).gaps.at(1).before, 90.0);
  EXPECT_EQ(kept.heldout_after, 1.009);
  CoefficientDatabase database("");
  EXPECT_EQ(database.evidence().add(std::vector<ModelImprovement>{kept}), 1u);
  kept.stamp += 60.0;
  kept.report = "a copy";
  EXPECT_EQ(database.evidence().add(std::vector<ModelImprovement>{kept}), 0u);
  EXPECT_THAT(errorOf([&] { readImprovement(folder.write("bad.json", "{}")); }), HasSubstr("bad.json: "));
  EXPECT_THAT(errorOf([&] { readImprovement(folder.file("none")); }), HasSubstr("none: cannot be read"));
}

TEST(Database, healthFilesOfTheHammerAreRead) {
  const TemporaryFolder folder;
  const std::string head = "measured,bag,days,quantity,first,now,deviations,drifted,stamp\n";
  const auto rows = readHealth(folder.write(
      "health.csv",
      head + "tool x,b.bag,1.5,\"gain of the mode at 930 Hz, gone\",2e-8,0,,true,1700000000.5\n"));
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].quantity, "gain of the mode at 930 Hz, gone");
  EXPECT_EQ(rows[0].stamp, 1700000000.5);
  EXPECT_TRUE(std::isnan(rows[0].deviations));
  EXPECT_EQ(rows[0].drifted, 1.0);
  EXPECT_THAT(errorOf([&] { readHealth(folder.write("old.csv", "measured,bag\n")); }),
              HasSubstr("old.csv: line 1: column 'days' is missing"));
}

// loadmeter_database crash runs a full minute. Writers report acknowledged records through a pipe; they are
// killed and restarted one after the other.
TEST(Database, whatWasAcknowledgedSurvivesKilledWriters) {
  const TemporaryFolder folder;
  const std::string file = folder.file("shared.sqlite");
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  int next = 0;
  const auto launch = [&] {
    const int writer = next++;
    const pid_t pid = fork();
    if (pid != 0) return pid;
    try {
      CoefficientDatabase database(file);
      for (int i = 0;; ++i) {
        const int stamp = writer * 1000000 + i;
        database.add(recordOf("t", stamp, 1e9, 2.0));
        if (write(pipe_ends[1], &stamp, sizeof stamp) != sizeof stamp) break;
      }
    } catch (const std::exception& error) {
      std::fprintf(stderr, "writer: %s\n", error.what());
    }
    _exit(1);
  };
  std::vector<pid_t> writers;
  for (int i = 0; i < 8; ++i) writers.push_back(launch());
  std::set<int> acknowledged;
  int stamp = 0;
  for (int kill_at = 0; kill_at < 12; ++kill_at) {
    // Independent of the speed of the disk.
    for (int i = 0; i < 10 && read(pipe_ends[0], &stamp, sizeof stamp) == sizeof stamp; ++i)
      acknowledged.insert(stamp);
    pid_t& victim = writers[static_cast<std::size_t>(kill_at) % writers.size()];
    kill(victim, SIGKILL);
    int status = 0;
    waitpid(victim, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status));  // it was killed
    victim = launch();
  }
  for (const pid_t writer : writers) {
    kill(writer, SIGKILL);
    waitpid(writer, nullptr, 0);
  }
  close(pipe_ends[1]);
  while (read(pipe_ends[0], &stamp, sizeof stamp) == sizeof stamp) acknowledged.insert(stamp);
  close(pipe_ends[0]);
  const CoefficientDatabase database(file);
  std::set<int> there;
  for (const CoefficientRecord& r : database.records("", "")) there.insert(static_cast<int>(r.set.stamp));
  for (const int one : acknowledged) ASSERT_TRUE(there.count(one)) << one;
  std::printf("%zu acknowledged by 20 writers, %zu in the file\n", acknowledged.size(), there.size());
  EXPECT_GT(acknowledged.size(), 100u);
  // Killed between commit and acknowledgement: at most one each.
  EXPECT_LE(there.size() - acknowledged.size(), 20u);
}

}  // namespace
}  // namespace smartmill::loadmeter
