// Machines of a shop and their server: times of push and pull, and the records after either is killed.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_loadmeter/database/fleet.h"
#include "smartmill_loadmeter_testing/private_server.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT
using Clock = std::chrono::steady_clock;

struct Options {
  int machines = 50, records = 100000, lookups = 2000;
  bool only_lookups = false;
  unsigned seed = 1;
};

double seconds(const std::function<void()>& work) {
  const Clock::time_point begin = Clock::now();
  work();
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

std::string loginOf(int machine) {
  return "mill_" + std::to_string(machine);
}

// All machines are of two shops.
std::string shopOf(int machine) {
  return machine % 2 ? "second" : "first";
}

CoefficientRecord drawRecord(int machine, int number, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform;
  CoefficientRecord r;
  r.set.tool = "endmill " + std::to_string(6 + number % 10);
  r.set.material = "material " + std::to_string(number % 5);
  r.set.source = "load_meter";
  r.set.stamp = 1.7e9 + 60.0 * number + uniform(random);
  r.set.tests = 3;
  r.set.value = {
      1e9 * (0.8 + 0.4 * uniform(random)), NOT_A_NUMBER, NOT_A_NUMBER, 17e3, NOT_A_NUMBER, NOT_A_NUMBER};
  r.set.std_dev = {2e6, NOT_A_NUMBER, NOT_A_NUMBER, 100.0, NOT_A_NUMBER, NOT_A_NUMBER};
  r.machine = loginOf(machine);
  r.teeth = 3;
  r.diameter = 0.012;
  r.cutting_speed = 0.5 + 10.0 * uniform(random);
  r.feed_per_tooth = 6e-5;
  return r;
}

/// The shop: a server that stores what it acknowledges, and one file per machine.
class Shop {
 public:
  explicit Shop(const Options& options) : options_(options), server_(std::make_unique<PrivateServer>(true)) {
    migrateFleet(server_->url("owner"));
    for (int m = 0; m < options.machines; ++m) {
      FleetMember member;
      member.name = member.login = loginOf(m);
      member.shop = shopOf(m);
      enrol(server_->url("owner"), member, "");
      std::mt19937 random(options.seed * 1000 + static_cast<unsigned>(m));
      std::vector<CoefficientRecord> records;
      for (int i = 0; i < perMachine(); ++i) records.push_back(drawRecord(m, i, random));
      CoefficientDatabase(file(m)).add(records);
    }
  }

  int perMachine() const { return options_.records / options_.machines; }
  std::string file(int machine) const { return folder_.file(loginOf(machine) + ".sqlite"); }
  std::string url(int machine) const { return server_->url(loginOf(machine)); }
  std::size_t inShop(int machine) const { return CoefficientDatabase(url(machine)).size(); }
  PrivateServer& server() { return *server_; }

 private:
  Options options_;
  TemporaryFolder folder_;
  std::unique_ptr<PrivateServer> server_;
};

void say(const char* what, double time, const std::string& detail) {
  std::printf("%-58s %7.2f s  %s\n", what, time, detail.c_str());
  std::fflush(stdout);
}

std::string freshOf(const FleetTransfer& t) {
  return std::to_string(t.fresh) + " new of " + std::to_string(t.offered);
}

/// Machines of one shop push their files one after the other.
FleetTransfer pushAll(const Shop& shop, int first, int last, bool all) {
  FleetTransfer sum;
  for (int m = first; m < last; ++m) {
    CoefficientDatabase local(shop.file(m));
    const FleetTransfer one = push(local, shop.url(m), {}, all);
    sum.offered += one.offered;
    sum.fresh += one.fresh;
  }
  return sum;
}

/// A push in a separate process, killed after a number of acknowledged records.
void pushKilled(const Shop& shop, int machine, std::size_t after) {
  const pid_t client = fork();
  if (client < 0) throw Error("no process");
  if (client == 0) {
    CoefficientDatabase local(shop.file(machine));
    push(local, shop.url(machine), [&](const FleetTransfer& done) {
      if (done.offered >= after) raise(SIGKILL);
    });
    _exit(1);
  }
  int status = 0;
  waitpid(client, &status, 0);
  if (!WIFSIGNALED(status)) throw Error("the client ended by itself");
}

/// Kills the server within a batch after a number of acknowledged ones. @return acknowledged records
std::size_t pushIntoDeath(Shop& shop, int machine, int batches, std::string* error_text) {
  CoefficientDatabase local(shop.file(machine));
  std::size_t acknowledged = 0;
  int done = 0;
  std::thread killer;
  const auto killSoon = [&] {
    killer = std::thread([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(10 + batches));
      shop.server().kill();
    });
  };
  if (batches == 0) killSoon();
  try {
    push(local, shop.url(machine), [&](const FleetTransfer& sent) {
      acknowledged = sent.offered;
      if (++done == batches) killSoon();
    });
  } catch (const Error& error) {
    *error_text = error.what();
  }
  if (killer.joinable()) killer.join();
  return acknowledged;
}

bool kills(Shop& shop, const Options& o) {
  bool good = true;
  const int machine = 0;
  {
    // A file of many batches, as after a long time without a network.
    std::mt19937 random(o.seed + 77);
    std::vector<CoefficientRecord> records;
    for (int i = 0; i < 20000; ++i) records.push_back(drawRecord(machine, 1000000 + i, random));
    CoefficientDatabase(shop.file(machine)).add(records);
  }
  const std::size_t before = shop.inShop(machine);
  pushKilled(shop, machine, 6000);
  const std::size_t between = shop.inShop(machine);
  CoefficientDatabase local(shop.file(machine));
  const FleetTransfer rest = push(local, shop.url(machine));
  good = good && between + rest.fresh == before + 20000;
  std::printf("client killed after 6000 of 20000: %zu stored, then %s\n", between - before,
              freshOf(rest).c_str());

  for (const int batches : {0, 1, 3, 6, 9}) {
    std::mt19937 random(o.seed + 100 + static_cast<unsigned>(batches));
    std::vector<CoefficientRecord> records;
    for (int i = 0; i < 20000; ++i)
      records.push_back(drawRecord(machine, 2000000 + 100000 * batches + i, random));
    local.add(records);
    const std::size_t had = shop.inShop(machine);
    std::string error_text;
    const std::size_t acknowledged = pushIntoDeath(shop, machine, batches, &error_text);
    const double down = seconds([&] { shop.server().start(); });
    const std::size_t kept = shop.inShop(machine);
    const FleetTransfer again = push(local, shop.url(machine));
    const bool whole = kept >= had + acknowledged && kept + again.fresh == had + 20000 &&
                       shop.inShop(machine) == had + 20000;
    good = good && whole;
    std::printf(
        "server killed after %d batches: %zu acknowledged, %zu stored, restarted in %.1f s, then %s: %s\n "
        "   \"%s\"\n",
        batches, acknowledged, kept - had, down, freshOf(again).c_str(),
        whole ? "nothing lost, nothing twice" : "WRONG", error_text.c_str());
  }
  return good;
}

bool sameFileTwice(const Shop& shop, const Options& o) {
  std::mt19937 random(o.seed + 5);
  std::vector<CoefficientRecord> records;
  for (int i = 0; i < 10000; ++i) records.push_back(drawRecord(2, 3000000 + i, random));
  const std::size_t before = shop.inShop(2);
  for (const int m : {2, 4}) CoefficientDatabase(shop.file(m)).add(records);
  FleetTransfer results[2];
  const double time = seconds([&] {
    std::thread other([&] {
      CoefficientDatabase local(shop.file(4));
      results[1] = push(local, shop.url(4));
    });
    CoefficientDatabase local(shop.file(2));
    results[0] = push(local, shop.url(2));
    other.join();
  });
  say("two clients, the same 10,000 records, at once", time,
      std::to_string(results[0].fresh) + " + " + std::to_string(results[1].fresh) + " new");
  return shop.inShop(2) == before + 10000 && results[0].fresh + results[1].fresh == 10000;
}

bool away(Shop& shop, const Options& o) {
  shop.server().stop();
  CoefficientDatabase local(shop.file(6));
  std::mt19937 random(o.seed + 6);
  std::string error_text;
  const double time = seconds([&] {
    for (int hour = 0; hour < 24; ++hour) {
      for (int i = 0; i < 10; ++i) local.add(drawRecord(6, 4000000 + 10 * hour + i, random));
      try {
        push(local, shop.url(6));
      } catch (const Error& error) {
        error_text = error.what();
      }
    }
  });
  const std::size_t behind = local.synchronisation().behind();
  shop.server().start();
  const FleetTransfer done = push(local, shop.url(6));
  std::printf(
      "network away for 24 tries (%.2f s in all), 240 records kept locally: %zu pending, then %s\n    "
      "\"%s\"\n",
      time, behind, freshOf(done).c_str(), error_text.c_str());
  return behind == 240 && done.fresh == 240;
}

void lookUp(const Shop& shop, const Options& o) {
  const CoefficientDatabase fleet(shop.url(1));
  std::mt19937 random(o.seed + 9);
  std::uniform_real_distribution<double> uniform;
  const std::function<void()> echo = roundTripTimer(shop.url(1));
  std::vector<double> estimates, newest, bare;
  for (int i = 0; i < o.lookups; ++i) {
    const int number = static_cast<int>(1000 * uniform(random));
    const CoefficientQuery query{"endmill " + std::to_string(6 + number % 10),
                                 "material " + std::to_string(number % 5), 0.5 + 10.0 * uniform(random),
                                 6e-5};
    bool found = false;
    bare.push_back(1e3 * seconds(echo));
    estimates.push_back(1e3 * seconds([&] { found = fleet.estimate(query).has_value(); }));
    newest.push_back(1e3 * seconds([&] { found = found && fleet.find(query.tool, query.material); }));
    if (!found) throw Error("a pair that is there was not found");
  }
  std::vector<double> both;
  for (std::size_t i = 0; i < newest.size(); ++i) both.push_back(newest[i] + estimates[i]);
  const auto line = [](const char* name, std::vector<double> times) {
    std::printf("%-58s median %.2f ms, 99 %% %.2f ms, slowest %.2f ms\n", name, median(times),
                percentile(times, 0.99), *std::max_element(times.begin(), times.end()));
  };
  line("SELECT 1 between them", bare);
  line("look-up with row-level security: newest of a pair", newest);
  line("look-up with row-level security: estimate of a cut", estimates);
  line("look-up with row-level security: both", both);
  for (std::size_t i = 0; i < both.size(); ++i) both[i] -= 2.0 * bare[i];
  line("  less two SELECT 1, pair by pair", both);
}

// A full disk is a small file system in memory: root only.
bool fullDisk(const Options& o) {
  const TemporaryFolder folder;
  const std::string mount = folder.file("disk");
  std::filesystem::create_directory(mount);
  if (getuid() != 0 ||
      std::system(("mount -t tmpfs -o size=72m tmpfs " + mount + " 2> /dev/null").c_str()) != 0) {
    std::printf("full disk: skipped, no small file system can be mounted here\n");
    return true;
  }
  std::filesystem::permissions(folder.file(""),
                               std::filesystem::perms::others_exec | std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  bool good = true;
  {
    PrivateServer server(true, mount);
    migrateFleet(server.url("owner"));
    FleetMember member;
    member.name = member.login = "mill";
    member.shop = "first";
    enrol(server.url("owner"), member, "");
    CoefficientDatabase local(folder.file("mill.sqlite"));
    std::mt19937 random(o.seed + 11);
    std::vector<CoefficientRecord> records;
    for (int i = 0; i < 60000; ++i) records.push_back(drawRecord(0, i, random));
    local.add(records);
    std::size_t acknowledged = 0;
    std::string error_text;
    try {
      push(local, server.url("mill"), [&](const FleetTransfer& done) { acknowledged = done.offered; });
    } catch (const Error& error) {
      error_text = error.what();
    }
    std::size_t there = 0;
    const std::size_t behind = local.synchronisation().behind();
    if (std::system(("mount -o remount,size=400m " + mount).c_str()) != 0) throw Error("no remount");
    // The server may have ended by itself or still run.
    server.stop();
    server.start();
    there = CoefficientDatabase(server.url("mill")).size();
    const FleetTransfer rest = push(local, server.url("mill"));
    good = !error_text.empty() && there >= acknowledged && behind == 60000 - acknowledged &&
           CoefficientDatabase(server.url("mill")).size() == 60000;
    std::printf(
        "full disk: %zu acknowledged, %zu stored, %zu pending; after the disk is enlarged %s: %s\n    "
        "\"%s\"\n",
        acknowledged, there, behind, freshOf(rest).c_str(), good ? "nothing lost" : "WRONG",
        error_text.c_str());
  }
  if (std::system(("umount -l " + mount).c_str()) != 0)
    std::fprintf(stderr, "%s stays mounted\n", mount.c_str());
  return good;
}

bool run(const Options& o) {
  if (!fleetSupported() || !PrivateServer::available())
    throw Error("PostgreSQL or libpq is missing: ./setup --with-fleet");
  std::unique_ptr<Shop> shop;
  const double made = seconds([&] { shop = std::make_unique<Shop>(o); });
  say("server, logins and files made", made, std::to_string(o.machines) + " machines");
  FleetTransfer done;
  double time = seconds([&] { done = pushAll(*shop, 0, o.machines, false); });
  say("push of all, one machine after the other", time, freshOf(done));
  bool good = done.fresh == static_cast<std::size_t>(shop->perMachine() * o.machines);
  time = seconds([&] { done = pushAll(*shop, 0, o.machines, false); });
  say("push again: noted as sent", time, freshOf(done));
  time = seconds([&] { done = pushAll(*shop, 0, o.machines, true); });
  say("push of everything anew (--all)", time, freshOf(done));
  good = good && done.fresh == 0;
  lookUp(*shop, o);
  if (o.only_lookups) return good;
  time = seconds([&] {
    CoefficientDatabase local(shop->file(1));
    done = pull(local, shop->url(1));
  });
  say("pull by one machine of its shop's others", time, freshOf(done));
  good = good && done.fresh == static_cast<std::size_t>(shop->perMachine() * (o.machines / 2 - 1));
  time = seconds([&] {
    CoefficientDatabase local(shop->file(1));
    done = pull(local, shop->url(1));
  });
  say("pull again", time, freshOf(done));
  good = kills(*shop, o) && good;
  good = sameFileTwice(*shop, o) && good;
  good = away(*shop, o) && good;
  good = fullDisk(o) && good;
  std::printf("nothing lost, nothing twice: %s\n", good ? "met" : "missed");
  return good;
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CommandLine line("Machines of a shop and their server: times of push and pull, and records after kills.");
  line.option("--machines", o.machines).showDefault().within(8, 90);
  line.option("--records", o.records, "total number of all machines").showDefault().within(1000, 10000000);
  line.option("--lookups", o.lookups).showDefault().within(10, 1000000);
  line.flag("--only-lookups", o.only_lookups, "push and look-ups only, without kills");
  line.option("--seed", o.seed, "of the records").showDefault();
  return runProgram(line, argc, argv, [&] { return run(o) ? 0 : 1; });
}
