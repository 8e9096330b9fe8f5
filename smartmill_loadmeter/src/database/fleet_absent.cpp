// Replaces fleet_postgresql.cpp without libpq.
#include "fleet_server.h"
#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

[[noreturn]] void refuse(const std::string& url) {
  throw Error(withoutPassword(url) + ": this build has no libpq; install it with `./setup --with-fleet`");
}

}  // namespace

bool fleetSupported() {
  return false;
}
std::unique_ptr<FleetServer> connectFleet(const std::string& url) {
  refuse(url);
}
int migrateFleet(const std::string& url, int) {
  refuse(url);
}
void enrol(const std::string& url, const FleetMember&, const std::string&) {
  refuse(url);
}

}  // namespace smartmill::loadmeter
