// Pushes to a fleet's server while clients and the server are killed and connections are cut: the
// logs of the clients are compared with the records of the server.
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "loadmeter/fleet_history.h"
#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_loadmeter/database/fleet.h"
#include "smartmill_loadmeter_testing/private_server.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT
using namespace smartmill::studies;    // NOLINT

constexpr std::string_view COMMIT("COMMIT\0", 7);  // as it is sent, not that of ON COMMIT DROP
constexpr const char* SOCKET = "/.s.PGSQL.5432";
constexpr std::array<const char*, 3> MACHINES{{"mill_a", "mill_b", "mill_c"}};

struct Options {
  int rounds = 200, records = 40;
  unsigned seed = 1;
};

sockaddr_un addressOf(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) throw Error(path + ": too long for a socket");
  std::strcpy(address.sun_path, path.c_str());
  return address;
}

/// The network between clients and server: passes the bytes of each connection, and cuts those whose answers
/// exceed a number of bytes, or when a COMMIT is answered, so that the client does not see the rest.
class Network {
 public:
  Network(std::string server, const std::string& client)
      : server_(std::move(server)), listener_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const sockaddr_un address = addressOf(client);
    if (::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(listener_, 16) != 0)
      throw Error(client + ": no socket");
    acceptor_ = std::thread([this] { accept(); });
  }
  ~Network() {
    ended_ = true;
    acceptor_.join();
    for (std::thread& connection : connections_) connection.join();
    ::close(listener_);
  }
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  /// Of each connection from now on; a negative number: none is cut
  void cutAfter(std::int64_t answered) { cut_after_ = answered; }
  /// Whether the answer to a COMMIT is lost, from now on.
  void loseCommits(bool lose) { lose_commits_ = lose; }
  std::size_t cuts() const { return cuts_; }

 private:
  void accept() {
    while (!ended_) {
      pollfd waiting{listener_, POLLIN, 0};
      if (::poll(&waiting, 1, 20) <= 0) continue;
      const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
      if (client >= 0) connections_.emplace_back([this, client] { pass(client); });
    }
  }
  void pass(int client) {
    const int server = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_un address = addressOf(server_);
    bool open = ::connect(server, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    std::int64_t answered = 0;
    bool commits = false;  // the last request
    std::array<char, 65536> bytes;
    while (open && !ended_) {
      std::array<pollfd, 2> ends{{{client, POLLIN, 0}, {server, POLLIN, 0}}};
      if (::poll(ends.data(), ends.size(), 20) <= 0) continue;
      for (std::size_t from = 0; from < ends.size() && open; ++from) {
        if (ends[from].revents == 0) continue;
        const ssize_t count = ::recv(ends[from].fd, bytes.data(), bytes.size(), 0);
        open = count > 0;
        if (open && from == 0)
          commits =
              lose_commits_ && std::string_view(bytes.data(), static_cast<std::size_t>(count)).find(COMMIT) !=
                                   std::string_view::npos;
        if (open && from == 1) {
          answered += count;
          const std::int64_t limit = cut_after_;
          if (commits || (limit >= 0 && answered > limit)) {
            ++cuts_;
            open = false;
          }
        }
        for (ssize_t sent = 0; open && sent < count;) {
          const ssize_t more = ::send(ends[1 - from].fd, bytes.data() + sent,
                                      static_cast<std::size_t>(count - sent), MSG_NOSIGNAL);
          open = more > 0;
          sent += more;
        }
      }
    }
    // Processes of clients have copies of both.
    for (const int end : {server, client}) {
      ::shutdown(end, SHUT_RDWR);
      ::close(end);
    }
  }

  std::string server_;
  int listener_;
  std::atomic<bool> ended_{false};
  std::atomic<std::int64_t> cut_after_{-1};
  std::atomic<bool> lose_commits_{false};
  std::atomic<std::size_t> cuts_{0};
  std::thread acceptor_;
  std::vector<std::thread> connections_;
};

/// Server, network, and a file and a log for each machine.
class Shop {
 public:
  explicit Shop(const Options& options) : options_(options), server_(true) {
    migrateFleet(server_.url("owner"));
    for (const char* machine : MACHINES) {
      FleetMember member;
      member.name = member.login = machine;
      member.shop = "shop";
      enrol(server_.url("owner"), member, "");
    }
    const std::string url = server_.url("owner");
    network_ =
        std::make_unique<Network>(url.substr(url.find("host=") + 5) + SOCKET, folder_.file("") + SOCKET);
  }

  PrivateServer& server() { return server_; }
  Network& network() { return *network_; }

  void addRecords(const std::string& machine) {
    std::size_t& count = count_[machine];
    CoefficientDatabase file(fileOf(machine));
    for (int i = 0; i < options_.records; ++i) file.add(recordOf(machine, count++));
  }

  /// A push in a process of its own, which is tried twice. @return its process
  pid_t push(const std::string& machine) {
    const std::size_t count = count_[machine];
    const pid_t client = ::fork();
    if (client != 0) return client;
    std::ofstream log(folder_.file(machine + ".log"), std::ios::app);
    const auto note = [&](const char* what, std::size_t first, std::size_t last) {
      log << what << " " << first << " " << last << std::endl;
    };
    for (int tries = 0; tries < 2; ++tries) {
      try {
        CoefficientDatabase file(fileOf(machine));
        const std::string fleet = file.synchronisation().lastFleet();
        const std::size_t first = fleet.empty() ? 0 : count - file.synchronisation().behind();
        note("attempted", first, count);
        loadmeter::push(file, url(machine), [&](const FleetTransfer& done) {
          note("acknowledged", first, first + done.offered);
        });
        ::_exit(0);
      } catch (const std::exception&) {
        continue;
      }
    }
    ::_exit(1);
  }

  /// Of the server itself, not through the network.
  std::vector<CoefficientRecord> stored() const {
    return CoefficientDatabase(server_.url(MACHINES[0])).records("", "");
  }
  PushHistory history() const {
    PushHistory history;
    for (const char* machine : MACHINES)
      history[machine] = readPushEvents(folder_.file(std::string(machine) + ".log"));
    return history;
  }
  std::size_t records() const {
    std::size_t sum = 0;
    for (const auto& [machine, count] : count_) sum += count;
    return sum;
  }

 private:
  std::string fileOf(const std::string& machine) const { return folder_.file(machine + ".sqlite"); }
  std::string url(const std::string& machine) const {
    return "postgresql://" + machine + "@/postgres?host=" + folder_.file("");
  }

  Options options_;
  TemporaryFolder folder_;
  PrivateServer server_;
  std::unique_ptr<Network> network_;
  std::map<std::string, std::size_t> count_;  // records in the file
};

struct Counts {
  std::size_t clients_killed = 0, servers_killed = 0, failed = 0, checks = 0, violations = 0;
  UnknownRecords unknown;  // at the checks
};

void wait(std::vector<pid_t>& clients, Counts& counts) {
  for (const pid_t client : clients) {
    int status = 0;
    ::waitpid(client, &status, 0);
    counts.clients_killed += WIFSIGNALED(status) ? 1 : 0;
    counts.failed += WIFEXITED(status) && WEXITSTATUS(status) != 0 ? 1 : 0;
  }
  clients.clear();
}

void check(const Shop& shop, Counts& counts) {
  const PushHistory history = shop.history();
  const std::vector<CoefficientRecord> stored = shop.stored();
  for (const std::string& violation : violationsOf(history, stored)) {
    std::printf("%s\n", violation.c_str());
    ++counts.violations;
  }
  const UnknownRecords unknown = unknownOf(history, stored);
  counts.unknown.stored += unknown.stored;
  counts.unknown.absent += unknown.absent;
  ++counts.checks;
}

// All machines push at once; in each round one thing fails.
void runRound(Shop& shop, std::mt19937& random, Counts& counts) {
  enum class Fault { none, client, server, network, commit };
  std::discrete_distribution<int> kinds{1.0, 4.0, 1.0, 2.0, 2.0};
  const auto fault = static_cast<Fault>(kinds(random));
  std::uniform_int_distribution<int> soon(0, 30), bytes(0, 2500);
  std::uniform_int_distribution<std::size_t> which(0, MACHINES.size() - 1);
  shop.network().cutAfter(fault == Fault::network ? bytes(random) : -1);
  shop.network().loseCommits(fault == Fault::commit);
  std::vector<pid_t> clients;
  for (const char* machine : MACHINES) {
    shop.addRecords(machine);
    clients.push_back(shop.push(machine));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(soon(random)));
  if (fault == Fault::client) ::kill(clients[which(random)], SIGKILL);
  if (fault == Fault::server) shop.server().kill();
  wait(clients, counts);
  shop.network().cutAfter(-1);
  shop.network().loseCommits(false);
  if (fault == Fault::server) {
    ++counts.servers_killed;
    shop.server().start();
  }
  check(shop, counts);
}

bool run(const Options& options) {
  if (!fleetSupported() || !PrivateServer::available())
    throw Error("PostgreSQL or libpq is missing: ./setup --with-fleet");
  Shop shop(options);
  std::mt19937 random(options.seed);
  Counts counts;
  for (int round = 0; round < options.rounds; ++round) runRound(shop, random, counts);
  // At last each client repeats its push until it is acknowledged.
  std::vector<pid_t> clients;
  for (const char* machine : MACHINES) clients.push_back(shop.push(machine));
  wait(clients, counts);
  check(shop, counts);
  const std::size_t stored = shop.stored().size();
  const UnknownRecords left = unknownOf(shop.history(), shop.stored());
  std::printf(
      "%d rounds of 3 pushes of %d records: %zu clients killed, %zu servers killed, %zu connections cut, "
      "%zu pushes failed twice\n",
      options.rounds, options.records, counts.clients_killed, counts.servers_killed, shop.network().cuts(),
      counts.failed);
  std::printf("%zu checks; records without an answer at a check: %zu stored, %zu not\n", counts.checks,
              counts.unknown.stored, counts.unknown.absent);
  std::printf("at the end %zu of %zu records stored, %zu without an answer; violations: %zu\n", stored,
              shop.records(), left.stored + left.absent, counts.violations);
  return counts.violations == 0 && stored == shop.records() && left.stored + left.absent == 0;
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CommandLine line(
      "Pushes to a fleet's server while clients and server are killed and connections are cut; the "
      "logs of the clients are compared with the records of the server.");
  line.option("--rounds", o.rounds).showDefault().within(1, 100000);
  line.option("--records", o.records, "of each machine in a round").showDefault().within(1, 10000);
  line.option("--seed", o.seed).showDefault();
  return runProgram(line, argc, argv, [&] { return run(o) ? 0 : 1; });
}
