#include "sqlite_tables.h"

#include <SQLiteCpp/Column.h>
#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Transaction.h>
#include <sqlite3.h>

#include <chrono>
#include <string>
#include <thread>

#include "record_fields.h"

namespace smartmill::loadmeter {

namespace {

// 1: coefficients. 2: adds improvements and health, and the state of synchronisation of each kind. 3: adds
// the time of the first test, wear and temperature to coefficients. 4: adds inspections.
constexpr int SCHEMA = 4;

std::string createOf(const RecordKind& kind) {
  std::string sql = "CREATE TABLE " + kind.table + " (id INTEGER PRIMARY KEY, identity TEXT NOT NULL UNIQUE";
  if (kind.by_speed) sql += ", speed_bucket INTEGER NOT NULL";
  for (const std::string& name : kind.words) sql += ", " + name + " TEXT NOT NULL";
  for (const std::string& name : kind.numbers) sql += ", " + name + " REAL";
  return sql + ")";
}

int version(SQLite::Database& db) {
  return db.execAndGet("PRAGMA user_version").getInt();
}

void switchToWriteAheadLog(SQLite::Database& db) {
  // The journal mode is stored in the file, so that only one process switches it.
  const bool is_wal = db.execAndGet("PRAGMA journal_mode").getString() == "wal";
  for (int tries = 0; !is_wal; ++tries) {
    try {
      db.exec("PRAGMA journal_mode=WAL");
      break;
    } catch (const SQLite::Exception& error) {
      // SQLite does not wait for other processes when it switches the mode.
      if (tries == 200 || error.getErrorCode() != SQLITE_BUSY) throw;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
}

void requireOurs(SQLite::Database& db) {
  const int tables = db.execAndGet("SELECT count(*) FROM sqlite_master").getInt();
  const bool ours =
      db.execAndGet("SELECT count(*) FROM sqlite_master WHERE name = 'coefficients'").getInt() > 0;
  if (tables > 0 && !ours) throw SQLite::Exception("not a database of cutting coefficients");
  if (version(db) > SCHEMA) {
    throw SQLite::Exception("schema " + std::to_string(version(db)) +
                            " of a newer version, expected at most " + std::to_string(SCHEMA));
  }
}

void makeFirst(SQLite::Database& db) {
  db.exec(createOf(coefficientKind()));
  db.exec("CREATE INDEX pair ON coefficients (material, tool, speed_bucket, stamp)");
  db.exec("CREATE INDEX material_speed ON coefficients (material, speed_bucket, stamp)");
  db.exec("CREATE INDEX newest ON coefficients (material, tool, stamp)");
  db.exec("CREATE INDEX newest_of_tool ON coefficients (tool, stamp)");
  db.exec("CREATE INDEX newest_of_material ON coefficients (material, stamp)");
  db.exec("CREATE INDEX newest_of_all ON coefficients (stamp)");
  db.exec("PRAGMA user_version=1");
}

// Some files of version 1 have the table `sent`, for coefficients only.
void makeSecond(SQLite::Database& db) {
  db.exec(createOf(improvementKind()));
  db.exec(createOf(healthKind()));
  db.exec(
      "CREATE TABLE handed (fleet TEXT, kind TEXT, last INTEGER, at REAL, PRIMARY KEY (fleet, kind));"
      "CREATE TABLE IF NOT EXISTS sent (fleet TEXT PRIMARY KEY, last INTEGER, at REAL);"
      "INSERT INTO handed SELECT fleet, 'coefficients', last, at FROM sent;"
      "DROP TABLE sent");
  db.exec("PRAGMA user_version=2");
}

void makeThird(SQLite::Database& db) {
  for (const NumberField& f : numberFields()) {
    if (!f.since_schema_3) continue;
    const int present =
        db.execAndGet("SELECT count(*) FROM pragma_table_info('coefficients') WHERE name = '" + f.name + "'")
            .getInt();
    if (present == 0) db.exec("ALTER TABLE coefficients ADD COLUMN " + f.name + " REAL");
  }
  db.exec("PRAGMA user_version=3");
}

void makeFourth(SQLite::Database& db) {
  db.exec(createOf(inspectionKind()));
  db.exec("PRAGMA user_version=4");
}

}  // namespace

void prepareTables(SQLite::Database& db) {
  requireOurs(db);  // before anything is written
  switchToWriteAheadLog(db);
  db.exec("PRAGMA synchronous=FULL");
  if (version(db) < SCHEMA) {
    SQLite::Transaction transaction(db, SQLite::TransactionBehavior::IMMEDIATE);
    // Another process may have done it meanwhile.
    if (version(db) == 0) makeFirst(db);
    if (version(db) == 1) makeSecond(db);
    if (version(db) == 2) makeThird(db);
    if (version(db) == 3) makeFourth(db);
    transaction.commit();
  }
}

}  // namespace smartmill::loadmeter
