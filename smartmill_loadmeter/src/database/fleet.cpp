#include "smartmill_loadmeter/database/fleet.h"

#include "fleet_server.h"
#include "record_fields.h"
#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

constexpr std::size_t BATCH = 2000;  // records of a transaction: about 50 ms, 2 MB

void mustBeFleet(const std::string& url) {
  if (!isFleet(url)) throw Error("'" + url + "': a fleet's server is due, postgresql://USER@HOST/DATABASE");
}

void mustBeFile(const CoefficientDatabase& local) {
  if (isFleet(local.file()))
    throw Error(withoutPassword(local.file()) + ": the machine's own file is due here");
}

}  // namespace

bool isFleet(const std::string& name) {
  return name.rfind("postgresql://", 0) == 0 || name.rfind("postgres://", 0) == 0;
}

std::string withoutPassword(const std::string& url) {
  std::string shown = url;
  const std::size_t begin = shown.find("://"), end = shown.find_first_of("/?", begin + 3);
  const std::size_t at = shown.substr(0, end).rfind('@');
  const std::size_t colon = begin == std::string::npos ? begin : shown.find(':', begin + 3);
  if (at != std::string::npos && colon < at) shown.erase(colon, at - colon);
  const std::size_t word = shown.find("password=");
  if (word != std::string::npos) shown.erase(word + 9, shown.find('&', word) - (word + 9));
  return shown;
}

FleetTransfer push(CoefficientDatabase& local, const std::string& url, const FleetProgress& progress,
                   bool all) {
  mustBeFleet(url);
  mustBeFile(local);
  const auto server = connectFleet(url);
  const std::string fleet = server->identity();
  FleetTransfer done;
  for (const RecordKind& kind : recordKinds()) {
    if (all) local.markSent(fleet, kind, 0);
    while (true) {
      const CoefficientDatabase::Batch batch = local.unsent(fleet, kind, BATCH);
      if (batch.rows.empty()) break;
      done.fresh += server->add(kind, batch.rows);
      // An end between the two sends the batch again, which adds nothing.
      local.markSent(fleet, kind, batch.last);
      done.offered += batch.rows.size();
      if (progress) progress(done);
    }
  }
  server->notePush(done, local.unsentCount(fleet));
  return done;
}

FleetTransfer pull(CoefficientDatabase& local, const std::string& url, const FleetProgress& progress) {
  mustBeFleet(url);
  mustBeFile(local);
  const auto server = connectFleet(url);
  const std::string fleet = server->identity();
  FleetTransfer done;
  for (const RecordKind& kind : recordKinds()) {
    server->missing(kind, local.identities(kind), [&](const std::vector<Row>& batch) {
      done.fresh += local.addFrom(fleet, kind, batch);
      done.offered += batch.size();
      if (progress) progress(done);
    });
  }
  return done;
}

std::function<void()> fleetEcho(const std::string& url) {
  mustBeFleet(url);
  return [server = std::shared_ptr<FleetServer>(connectFleet(url))] { server->echo(); };
}

std::vector<FleetMember> fleetMembers(const std::string& url) {
  mustBeFleet(url);
  return connectFleet(url)->members();
}

}  // namespace smartmill::loadmeter
