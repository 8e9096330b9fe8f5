#include "smartmill_loadmeter_testing/private_server.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

/// Folder of the newest installed PostgreSQL with a trailing slash; empty: none.
std::string programs() {
  const std::filesystem::path root = "/usr/lib/postgresql";
  int newest = 0;
  std::error_code absent;
  for (const auto& entry : std::filesystem::directory_iterator(root, absent)) {
    const int version = std::atoi(entry.path().filename().c_str());
    if (access((entry.path() / "bin/pg_ctl").c_str(), X_OK) == 0) newest = std::max(newest, version);
  }
  return newest == 0 ? "" : (root / std::to_string(newest) / "bin/").string();
}

}  // namespace

bool PrivateServer::available() {
  return !programs().empty();
}

PrivateServer::PrivateServer(bool durable, const std::string& folder)
    : durable_(durable), own_(folder.empty()), folder_(folder) {
  if (own_) {
    // The path of a socket has at most 107 bytes.
    std::string pattern = "/tmp/smartmill_pg_XXXXXX";
    if (!mkdtemp(pattern.data())) throw Error("temporary folder cannot be created");
    folder_ = pattern;
  }
  // The server does not run as root.
  if (getuid() == 0 && std::system(("chown postgres " + folder_).c_str()) != 0)
    throw Error("user postgres not found");
  if (execute("initdb -D " + folder_ + "/data -U owner --auth=trust -E UTF8 --locale=C --no-sync") != 0)
    throw Error(folder_ + ": initdb failed");
  std::ofstream(folder_ + "/data/pg_hba.conf", std::ios::trunc)
      << "local all locked scram-sha-256\nlocal all all trust\n";
  start();
}

PrivateServer::~PrivateServer() {
  stop();
  std::error_code ignored;
  if (own_) std::filesystem::remove_all(folder_, ignored);
}

int PrivateServer::execute(const std::string& command) const {
  const std::string as = getuid() == 0 ? "runuser -u postgres -- " : "";
  return std::system(("cd " + folder_ + " && " + as + programs() + command + " > /dev/null 2>&1").c_str());
}

std::string PrivateServer::url(const std::string& login, const std::string& password,
                               const std::string& database) const {
  return "postgresql://" + login + (password.empty() ? "" : ":" + password) + "@/" + database +
         "?host=" + folder_;
}

void PrivateServer::start() {
  const std::string fast = durable_ ? "" : " -c fsync=off -c full_page_writes=off";
  const std::string command = "pg_ctl -D " + folder_ + "/data -w -t 30 -l " + folder_ +
                              "/log -o \"-c listen_addresses='' " + "-c unix_socket_directories='" + folder_ +
                              "' -c shared_buffers=64MB -c max_connections=100" + fast + "\" start";
  // After a kill the old backends end with a delay.
  for (int tries = 0; execute(command) != 0; ++tries) {
    if (tries == 20) throw Error(folder_ + ": the server does not start, see its log");
    usleep(250000);
  }
}

void PrivateServer::stop() {
  execute("pg_ctl -D " + folder_ + "/data -m immediate -w stop");
}

void PrivateServer::kill() {
  std::ifstream file(folder_ + "/data/postmaster.pid");
  pid_t pid = 0;
  if (file >> pid && pid > 1) ::kill(pid, SIGKILL);
}

void PrivateServer::makeDatabase(const std::string& name) {
  if (execute("createdb -h " + folder_ + " -U owner " + name) != 0) throw Error(name + ": createdb failed");
}

bool PrivateServer::run(const std::string& login, const std::string& database, const std::string& sql) const {
  return execute("psql -q -v ON_ERROR_STOP=1 -h " + folder_ + " -U " + login + " " + database + " -c \"" +
                 sql + "\"") == 0;
}

}  // namespace smartmill::loadmeter
