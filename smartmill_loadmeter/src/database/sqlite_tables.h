#pragma once

#include <SQLiteCpp/Database.h>

namespace smartmill::loadmeter {

/// Creates the tables of a machine's file, or updates those of an older version. Several processes may do so.
/// @throws SQLite::Exception when the file is not such a database.
void prepareTables(SQLite::Database& db);

}  // namespace smartmill::loadmeter
