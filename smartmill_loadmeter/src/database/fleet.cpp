#include "smartmill_loadmeter/database/fleet.h"

#include "fleet_server.h"
#include "record_fields.h"
#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

void requireServerUrl(const std::string& url) {
  if (!isServerUrl(url)) throw Error("'" + url + "': expected a server, postgresql://USER@HOST/DATABASE");
}

std::unique_ptr<FleetServer> connect(const CoefficientDatabase& local, const std::string& url) {
  requireServerUrl(url);
  if (isServerUrl(local.file()))
    throw Error(withoutPassword(local.file()) + ": expected the machine's file, not a server");
  return connectFleet(url);
}

}  // namespace

bool isServerUrl(const std::string& name) {
  return name.rfind("postgresql://", 0) == 0 || name.rfind("postgres://", 0) == 0;
}

std::string withoutPassword(const std::string& url) {
  std::string displayed = url;
  const std::size_t begin = displayed.find("://"), end = displayed.find_first_of("/?", begin + 3);
  const std::size_t at = displayed.substr(0, end).rfind('@');
  const std::size_t colon = begin == std::string::npos ? begin : displayed.find(':', begin + 3);
  if (at != std::string::npos && colon < at) displayed.erase(colon, at - colon);
  const std::size_t word = displayed.find("password=");
  if (word != std::string::npos) displayed.erase(word + 9, displayed.find('&', word) - (word + 9));
  return displayed;
}

FleetTransfer push(CoefficientDatabase& local, const std::string& url, const FleetProgress& progress,
                   bool all) {
  const auto server = connect(local, url);
  const std::string fleet = server->identity();
  const FleetSynchronisation file = local.synchronisation();
  FleetTransfer transfer;
  for (const RecordKind& kind : recordKinds()) {
    if (all) file.markSent(fleet, kind, 0);
    while (true) {
      const FleetSynchronisation::Batch batch = file.unsent(fleet, kind, FLEET_BATCH);
      if (batch.rows.empty()) break;
      transfer.fresh += server->add(kind, batch.rows);
      // An interruption between the two sends the batch again, which adds nothing.
      file.markSent(fleet, kind, batch.last);
      transfer.offered += batch.rows.size();
      if (progress) progress(transfer);
    }
  }
  server->storePush(transfer, file.unsentCount(fleet));
  return transfer;
}

FleetTransfer pull(CoefficientDatabase& local, const std::string& url, const FleetProgress& progress) {
  const auto server = connect(local, url);
  const std::string fleet = server->identity();
  const FleetSynchronisation file = local.synchronisation();
  FleetTransfer transfer;
  for (const RecordKind& kind : recordKinds()) {
    server->missing(kind, file.identities(kind), [&](const std::vector<Row>& batch) {
      transfer.fresh += file.addFrom(fleet, kind, batch);
      transfer.offered += batch.size();
      if (progress) progress(transfer);
    });
  }
  return transfer;
}

std::function<void()> roundTripTimer(const std::string& url) {
  requireServerUrl(url);
  return [server = std::shared_ptr<FleetServer>(connectFleet(url))] { server->echo(); };
}

std::vector<FleetMember> fleetMembers(const std::string& url) {
  requireServerUrl(url);
  return connectFleet(url)->members();
}

}  // namespace smartmill::loadmeter
