#include "smartmill_loadmeter/database/database_location.h"

#include <sqlite3.h>

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

std::string contentOf(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void execute(const std::string& file, const char* sql) {
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &db), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(db, sql, nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(db);
}

CoefficientSet setOf(double ktc) {
  CoefficientSet k;
  k.tool = "t", k.material = "m", k.source = "load_meter", k.stamp = 1.0;
  k.value = k.std_dev = NOT_IDENTIFIED;
  k.value.ktc = ktc, k.std_dev.ktc = 1e6;
  return k;
}

// systemd.exec(5) and the XDG Base Directory Specification.
TEST(DatabaseLocation, isTheDataFolderOfServiceOrUser) {
  EXPECT_EQ(databaseFile({"/var/lib/smartmill:/var/lib/b", "/data", "/home/a"}, "mill 07", "/etc/m.yaml"),
            "/var/lib/smartmill/mill 07.sqlite");
  EXPECT_EQ(databaseFile({"", "/data", "/home/a"}, "", "/etc/mill.v2.yaml"),
            "/data/smartmill/mill.v2.sqlite");
  EXPECT_EQ(databaseFile({"", "", "/home/a"}, "a/../b", ""), "/home/a/.local/share/smartmill/a_.._b.sqlite");
  EXPECT_EQ(databaseFile({"", "relative", "/home/a"}, "..", ""),
            "/home/a/.local/share/smartmill/machine...sqlite");
  EXPECT_THAT(errorOf([] { databaseFile({"", "", ""}, "m", ""); }), HasSubstr("XDG_DATA_HOME or HOME"));
}

TEST(DatabaseLocation, theDefaultFileIsCreatedOnFirstUseAndKept) {
  const TemporaryFolder folder;
  const DataFolders folders{"", folder.file("data"), ""};
  const std::string file = folder.file("data") + "/smartmill/mill.sqlite";
  {
    const OpenedDatabase first = openDatabase("auto", "", "/models/mill.yaml", folders);
    EXPECT_EQ(first.file, file);
    EXPECT_EQ(first.problem, "");
    first.database->add(setOf(7e8));
  }
  EXPECT_EQ(openDatabase("auto", "", "mill.yaml", folders).database->find("t", "m")->value.ktc, 7e8);
  EXPECT_EQ(openDatabase(file, "other", "mill.yaml", folders).database->size(), 1u);
  for (const char* without : {"", "none"}) {
    const OpenedDatabase run = openDatabase(without, "", "mill.yaml", folders);
    EXPECT_EQ(run.file, "");
    EXPECT_EQ(run.problem, "");
    EXPECT_EQ(run.database->size(), 0u);
  }
}

// A file that is not ours stays as it is, byte by byte; the run continues without it, an explicit file is
// refused.
TEST(DatabaseLocation, anUnusableFileIsNamedAndUntouched) {
  const TemporaryFolder folder;
  const DataFolders folders{folder.file("state"), "", ""};
  fs::create_directories(folder.file("state"));
  const auto refuses = [&](const std::string& name, const std::string& reason) {
    const std::string file = folder.file("state") + "/" + name + ".sqlite";
    const std::string before = contentOf(file);
    const OpenedDatabase opened = openDatabase("auto", name, "", folders);
    EXPECT_EQ(opened.file, "");
    EXPECT_THAT(opened.problem, AllOf(HasSubstr(file), HasSubstr(reason),
                                      HasSubstr("records of this run only"), Not(HasSubstr("\n"))));
    opened.database->add(setOf(7e8));
    EXPECT_EQ(contentOf(file), before) << name;
    EXPECT_THAT(errorOf([&] { openDatabase(file, "", "", folders); }),
                AllOf(HasSubstr(file), HasSubstr(reason)));
    EXPECT_EQ(contentOf(file), before) << name;
  };
  std::ofstream(folder.file("state") + "/text.sqlite") << std::string(5000, 'x');
  refuses("text", "file is not a database");
  execute(folder.file("state") + "/foreign.sqlite", "CREATE TABLE photographs (a)");
  refuses("foreign", "not a database of cutting coefficients");
  const std::string newer = folder.file("state") + "/newer.sqlite",
                    damaged = folder.file("state") + "/damaged.sqlite";
  CoefficientDatabase(newer).add(setOf(7e8));
  execute(newer, "PRAGMA user_version=99; PRAGMA wal_checkpoint(TRUNCATE)");
  refuses("newer", "schema 99 of a newer version, expected at most 4");
  CoefficientDatabase(damaged).add(setOf(7e8));
  execute(damaged, "PRAGMA wal_checkpoint(TRUNCATE)");
  {
    std::fstream bytes(damaged, std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp(static_cast<std::streamoff>(fs::file_size(damaged)) / 4);
    bytes << std::string(fs::file_size(damaged) / 2, '\x5a');
  }
  refuses("damaged", "damaged: ");
}

// A path below a file cannot be a folder; root may write into read-only folders.
TEST(DatabaseLocation, withoutAWritableFolderTheRunGoesOn) {
  const TemporaryFolder folder;
  const std::string blocked = folder.write("blocked", "");
  const OpenedDatabase opened = openDatabase("auto", "mill", "", {"", blocked, ""});
  EXPECT_THAT(opened.problem, HasSubstr(blocked + "/smartmill: cannot be created"));
  EXPECT_TRUE(opened.database->add(setOf(7e8)));
  EXPECT_THAT(openDatabase("auto", "mill", "", {"", "", ""}).problem, HasSubstr("no data folder"));
}

}  // namespace
}  // namespace smartmill::loadmeter
