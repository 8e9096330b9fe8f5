// Tables of the fleet's server, their versions and access rights.
#include "fleet_schema.h"

#include "record_fields.h"
#include "smartmill_loadmeter/database/fleet.h"

namespace smartmill::loadmeter {

namespace {

// The owner's changes are one transaction; two owners wait for each other.
constexpr const char* LOCK = "SELECT pg_advisory_xact_lock(7365746)";

// 0: no tables yet.
int versionOf(FleetConnection& connection) {
  if (connection.execute("SELECT to_regclass('fleet')").word(0, 0).empty()) return 0;
  const QueryResult rows = connection.execute("SELECT schema FROM fleet");
  return rows.size() == 1 ? static_cast<int>(rows.number(0, 0)) : 0;
}

std::string makeRole(const std::string& role) {
  return "DO $$ BEGIN IF NOT EXISTS (SELECT 1 FROM pg_roles WHERE rolname = '" + role +
         "') THEN CREATE ROLE " + role + " NOLOGIN; END IF; END $$;";
}

// Version 1: machines, their records, and row-level security. Every index starts with the column of the
// policy. A record's column `machine` is the name in its file; machine_id is the sender, from the login.
std::string first() {
  std::string record;
  for (const TextField& f : textFields()) record += ", " + f.name + " text NOT NULL";
  for (const NumberField& f : numberFields()) record += ", " + f.name + " double precision";
  return makeRole("fleet_reader") + makeRole("fleet_machine") +
         "CREATE TABLE fleet (one bool PRIMARY KEY DEFAULT true CHECK (one), id uuid NOT NULL DEFAULT "
         "gen_random_uuid(), schema int NOT NULL);"
         "INSERT INTO fleet (schema) VALUES (1);"
         "CREATE TABLE machine (id int GENERATED ALWAYS AS IDENTITY PRIMARY KEY, name text UNIQUE NOT NULL, "
         "login "
         "name UNIQUE NOT NULL, shop text NOT NULL);"
         "CREATE TABLE coefficients (id bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY, identity text NOT "
         "NULL, "
         "shop text NOT NULL, machine_id int NOT NULL REFERENCES machine, received timestamptz NOT NULL "
         "DEFAULT "
         "now(), speed_bucket int NOT NULL" +
         record +
         ", UNIQUE (shop, identity));"
         "CREATE INDEX pair ON coefficients (shop, material, tool, speed_bucket, stamp DESC);"
         "CREATE INDEX newest ON coefficients (shop, material, tool, stamp DESC, id DESC);"
         "CREATE INDEX newest_of_material ON coefficients (shop, material, stamp DESC, id DESC);"
         "CREATE INDEX material_speed ON coefficients (shop, material, speed_bucket, stamp DESC);"
         "CREATE INDEX brought ON coefficients (shop, machine_id);"
         "ALTER TABLE coefficients ENABLE ROW LEVEL SECURITY; ALTER TABLE coefficients FORCE ROW LEVEL "
         "SECURITY;"
         "CREATE FUNCTION me() RETURNS machine LANGUAGE sql STABLE SECURITY DEFINER SET search_path = public "
         "AS "
         "'SELECT machine FROM machine WHERE login = session_user';"
         "CREATE POLICY shop_rows ON coefficients FOR SELECT TO fleet_machine USING (shop = (SELECT "
         "(me()).shop));"
         "CREATE POLICY own_insert ON coefficients FOR INSERT TO fleet_machine WITH CHECK (machine_id = "
         "(SELECT "
         "(me()).id) AND shop = (SELECT (me()).shop));"
         "CREATE POLICY read_all ON coefficients FOR SELECT TO fleet_reader USING (true);"
         "GRANT SELECT ON fleet TO fleet_machine, fleet_reader;"
         "GRANT SELECT, INSERT ON coefficients TO fleet_machine; GRANT SELECT ON coefficients, machine TO "
         "fleet_reader;"
         "GRANT USAGE ON ALL SEQUENCES IN SCHEMA public TO fleet_machine;";
}

// Version 2: time and backlog of each push, and the machines that a login may see.
std::string second() {
  return "CREATE TABLE push (id bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY, shop text NOT NULL, "
         "machine_id int "
         "NOT NULL REFERENCES machine, at timestamptz NOT NULL DEFAULT now(), offered bigint NOT NULL, fresh "
         "bigint "
         "NOT NULL, behind bigint NOT NULL);"
         "CREATE INDEX last_push ON push (shop, machine_id, at DESC);"
         "ALTER TABLE push ENABLE ROW LEVEL SECURITY; ALTER TABLE push FORCE ROW LEVEL SECURITY;"
         "CREATE POLICY shop_rows ON push FOR SELECT TO fleet_machine USING (shop = (SELECT (me()).shop));"
         "CREATE POLICY own_insert ON push FOR INSERT TO fleet_machine WITH CHECK (machine_id = (SELECT "
         "(me()).id) "
         "AND shop = (SELECT (me()).shop));"
         "CREATE POLICY read_all ON push FOR SELECT TO fleet_reader USING (true);"
         "CREATE FUNCTION members() RETURNS SETOF machine LANGUAGE sql STABLE SECURITY DEFINER SET "
         "search_path = "
         "public AS $$ SELECT * FROM machine WHERE shop = (SELECT (me()).shop) OR pg_has_role(session_user, "
         "'fleet_reader', 'MEMBER') $$;"
         "GRANT SELECT, INSERT ON push TO fleet_machine; GRANT SELECT ON push TO fleet_reader;"
         "GRANT USAGE ON ALL SEQUENCES IN SCHEMA public TO fleet_machine;"
         "UPDATE fleet SET schema = 2;";
}

// Table, index and policies as in version 1, for another kind of record.
std::string tableOf(const RecordKind& kind) {
  std::string columns;
  for (const std::string& name : kind.words) columns += ", " + name + " text NOT NULL";
  for (const std::string& name : kind.numbers) columns += ", " + name + " double precision";
  const std::string& t = kind.table;
  return "CREATE TABLE " + t +
         " (id bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY, identity text NOT NULL, shop text NOT NULL, "
         "machine_id int NOT NULL REFERENCES machine, received timestamptz NOT NULL DEFAULT now()" +
         columns + ", UNIQUE (shop, identity));CREATE INDEX " + t + "_brought ON " + t +
         " (shop, machine_id);ALTER TABLE " + t + " ENABLE ROW LEVEL SECURITY; ALTER TABLE " + t +
         " FORCE ROW LEVEL SECURITY;CREATE POLICY shop_rows ON " + t +
         " FOR SELECT TO fleet_machine USING (shop = (SELECT (me()).shop));CREATE POLICY own_insert ON " + t +
         " FOR INSERT TO fleet_machine WITH CHECK (machine_id = (SELECT (me()).id) AND shop = (SELECT "
         "(me()).shop));CREATE POLICY read_all ON " +
         t + " FOR SELECT TO fleet_reader USING (true);GRANT SELECT, INSERT ON " + t +
         " TO fleet_machine; GRANT SELECT ON " + t + " TO fleet_reader;";
}

// Version 3: model improvements and spindle health.
std::string third() {
  return tableOf(improvementKind()) + tableOf(healthKind()) +
         "GRANT USAGE ON ALL SEQUENCES IN SCHEMA public TO fleet_machine;UPDATE fleet SET schema = 3;";
}

// Version 4: time of the first test, wear and temperature of coefficients.
std::string fourth() {
  std::string sql;
  for (const NumberField& f : numberFields()) {
    if (f.since_schema_3)
      sql += "ALTER TABLE coefficients ADD COLUMN IF NOT EXISTS " + f.name + " double precision;";
  }
  return sql + "UPDATE fleet SET schema = 4;";
}

// Version 5: measured dimensions of parts.
std::string fifth() {
  return tableOf(inspectionKind()) +
         "GRANT USAGE ON ALL SEQUENCES IN SCHEMA public TO fleet_machine;UPDATE fleet SET schema = 5;";
}

}  // namespace

std::string checkFleet(FleetConnection& connection) {
  const int version = versionOf(connection);
  if (version == 0) connection.fail("no tables; create them with `coefficients_db URL migrate` by the owner");
  if (version < FLEET_SCHEMA)
    connection.fail("tables of version " + std::to_string(version) + ", expected " +
                    std::to_string(FLEET_SCHEMA) +
                    ": update them with `coefficients_db URL migrate` by the owner");
  if (version > FLEET_SCHEMA)
    connection.fail("tables of version " + std::to_string(version) + ", newer than this program's " +
                    std::to_string(FLEET_SCHEMA));
  return connection.execute("SELECT id FROM fleet").word(0, 0);
}

int migrateFleet(const std::string& url, int schema) {
  FleetConnection connection(url);
  int found = 0;
  connection.transaction("BEGIN", [&] {
    connection.execute(LOCK);
    found = versionOf(connection);
    if (found > schema)
      connection.fail("tables of version " + std::to_string(found) + " are newer than this program");
    const std::string steps[] = {first(), second(), third(), fourth(), fifth()};
    for (int version = found; version < schema; ++version) connection.execute(steps[version]);
  });
  return found;
}

void enrol(const std::string& url, const FleetMember& member, const std::string& password) {
  FleetConnection connection(url);
  checkFleet(connection);
  connection.transaction("BEGIN", [&] {
    connection.execute(LOCK);
    const std::string login = connection.name(member.login);
    if (connection.query("SELECT 1 FROM pg_roles WHERE rolname = $1", {member.login}).size() == 0)
      connection.execute("CREATE ROLE " + login + " LOGIN");
    connection.execute("GRANT fleet_machine TO " + login);
    if (!password.empty())
      connection.execute("ALTER ROLE " + login + " PASSWORD " + connection.literal(password));
    connection.query("INSERT INTO machine (name, login, shop) VALUES ($1, $2, $3) ON CONFLICT DO NOTHING",
                     {member.name, member.login, member.shop});
    const QueryResult rows =
        connection.query("SELECT 1 FROM machine WHERE name = $1 AND login = $2 AND shop = $3",
                         {member.name, member.login, member.shop});
    if (rows.size() == 0)
      connection.fail("machine '" + member.name + "' or login '" + member.login +
                      "' is enrolled with another name, login or shop");
  });
}

}  // namespace smartmill::loadmeter
