#include "loadmeter/shop_case.h"

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/signal/statistics.h"
#include "smartmill_loadmeter/database/fleet_model.h"
#include "study_case.h"

namespace smartmill::loadmeter {

namespace {

using nlohmann::json;

constexpr int MACHINES = 50, MATERIALS = 6, TOOLS = 3, FIRST_CUTS = 4, MOST_CUTS = 12;
constexpr double STATED = 0.01;  // [1] standard deviation stated by a record
constexpr double NAMED = 0.9;    // [1] probability from which a machine is named
const std::string LAST = "material " + std::to_string(MATERIALS - 1);

class Shop {
 public:
  Shop(std::uint64_t seed, int number) : random_(seedOfCase(seed, number)) {
    machine_ = between(0.01, 0.06);
    batch_ = between(0.005, 0.02);
    noise_ = std::sqrt(std::pow(between(0.01, 0.03), 2) - STATED * STATED);
    const double tool = between(0.03, 0.15);
    for (int j = 0; j < MATERIALS; ++j) {
      const double mean = std::log(between(600e6, 2200e6));
      for (int t = 0; t < TOOLS; ++t) groups_.push_back(mean + normal(tool));
    }
    for (int m = 0; m < MACHINES; ++m) {
      effects_.push_back(normal(machine_));
      for (int g = 0; g < MATERIALS * TOOLS; ++g) batches_.push_back(normal(batch_));
    }
    const int odd = number % 4 == 0 ? 0 : 2;
    for (int i = 0; i < odd; ++i)
      effects_[static_cast<std::size_t>(oddAt(i))] += sign() * between(0.12, 0.30);
    odd_ = odd;
  }

  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double normal(double deviation) { return std::normal_distribution<double>(0.0, deviation)(random_); }
  double sign() { return between(-1.0, 1.0) < 0.0 ? -1.0 : 1.0; }
  int oddCount() const { return odd_; }
  static int oddAt(int i) { return 20 + 7 * i; }
  bool isOdd(int machine) const { return odd_ > 0 && (machine == oddAt(0) || machine == oddAt(1)); }
  static bool isNew(int machine) { return machine % 3 == 0; }  // never cut the last material
  static std::string nameOf(int machine) { return "mill " + std::to_string(machine); }

  /// Mean of the machine's next cuts of this group.
  double truth(int machine, int material, int tool) const {
    const auto g = static_cast<std::size_t>(material * TOOLS + tool);
    return groups_[g] + effects_[static_cast<std::size_t>(machine)] +
           batches_[static_cast<std::size_t>(machine * MATERIALS * TOOLS) + g];
  }
  double effect(int machine) const { return effects_[static_cast<std::size_t>(machine)]; }
  FleetObservation cut(int machine, int material, int tool) {
    const double value = std::exp(truth(machine, material, tool) + normal(std::hypot(noise_, STATED)));
    return {nameOf(machine),
            "material " + std::to_string(material),
            "tool " + std::to_string(tool),
            value,
            STATED * value,
            0.0};
  }
  std::vector<FleetObservation> history() {
    std::vector<FleetObservation> observations;
    for (int m = 0; m < MACHINES; ++m) {
      for (int j = 0; j < MATERIALS; ++j) {
        if (j == MATERIALS - 1 && isNew(m)) continue;
        for (int t = 0; t < TOOLS; ++t) {
          if (between(0.0, 1.0) > 0.4) continue;
          const int cuts = 1 + static_cast<int>(between(0.0, 3.0));
          for (int c = 0; c < cuts; ++c) observations.push_back(cut(m, j, t));
        }
      }
    }
    return observations;
  }

 private:
  std::mt19937_64 random_;
  double machine_ = 0.0, batch_ = 0.0, noise_ = 0.0;
  int odd_ = 0;
  std::vector<double> groups_, effects_, batches_;
};

double meanSquare(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v * v / static_cast<double>(values.size());
  return sum;
}

double share(const std::vector<double>& z) {
  double inside = 0.0;
  for (const double one : z) inside += std::abs(one) < 1.96;
  return inside / static_cast<double>(z.size());
}

// Prediction by the machine alone before its first cut of a material: from its other materials.
double loneGuess(const std::vector<FleetObservation>& observations, const std::string& machine) {
  double sum = 0.0, count = 0.0;
  for (const FleetObservation& o : observations) {
    if (o.machine != machine) continue;
    sum += std::log(o.value);
    ++count;
  }
  return count > 0.0 ? sum / count : std::log(1.2e9);
}

/// Machines that never cut the last material: predictions of its first cuts, by the fleet and by the machine
/// alone.
void firstCuts(Shop& shop, const std::vector<FleetObservation>& observations, json* line) {
  std::vector<FleetObservation> grown = observations;
  std::vector<double> mean(MACHINES, 0.0);
  for (int cuts = 0; cuts <= FIRST_CUTS; ++cuts) {
    const FleetModel model(grown);
    std::vector<double> fleet, alone, z;
    for (int m = 0; m < MACHINES; m += 3) {
      const auto p = model.predict(Shop::nameOf(m), LAST, "tool 0");
      const double truth = shop.truth(m, MATERIALS - 1, 0), error = std::log(p->value) - truth;
      fleet.push_back(100.0 * std::abs(error));
      z.push_back(error / p->log_std);
      const double guess =
          cuts == 0 ? loneGuess(observations, Shop::nameOf(m)) : mean[static_cast<std::size_t>(m)];
      alone.push_back(100.0 * std::abs(guess - truth));
    }
    const std::string after = "after_" + std::to_string(cuts);
    (*line)[after] = {{"fleet_percent", median(fleet)},
                      {"alone_percent", median(alone)},
                      {"z2", meanSquare(z)},
                      {"inside", share(z)}};
    if (cuts == FIRST_CUTS) break;
    for (int m = 0; m < MACHINES; m += 3) {
      grown.push_back(shop.cut(m, MATERIALS - 1, 0));
      double& own = mean[static_cast<std::size_t>(m)];
      own += (std::log(grown.back().value) - own) / (cuts + 1.0);
    }
  }
}

/// Detection of outliers among machines with a history, and number of cuts to detect a new machine that is
/// off by a quarter.
void oddMachines(Shop& shop, const std::vector<FleetObservation>& observations, json* line) {
  const FleetModel model(observations);
  int found = 0, falsely = 0;
  std::vector<double> z;
  for (const MachineEffect& effect : model.machines()) {
    const int m = std::stoi(effect.machine.substr(5));
    z.push_back((effect.effect - shop.effect(m)) / effect.std_dev);
    if (effect.outlier <= NAMED) continue;
    (shop.isOdd(m) ? found : falsely)++;
  }
  (*line)["odd"] = shop.oddCount();
  (*line)["odd_found"] = found;
  (*line)["odd_falsely"] = falsely;
  (*line)["effects_z2"] = meanSquare(z);
  (*line)["effects_inside"] = share(z);
  std::vector<FleetObservation> grown = observations;
  int cuts = 0;
  double odd = 0.0;
  while (cuts < MOST_CUTS && odd <= NAMED) {
    FleetObservation o = shop.cut(1, cuts % MATERIALS, 0);
    // Off by a quarter from the fleet mean, independent of the machine that supplies the cuts.
    o.value *= std::exp(std::log(1.25) - shop.effect(1));
    o.machine = "newcomer";
    grown.push_back(o);
    ++cuts;
    for (const MachineEffect& effect : FleetModel(grown).machines())
      if (effect.machine == o.machine) odd = effect.outlier;
  }
  (*line)["newcomer_named"] = odd > NAMED;
  (*line)["newcomer_cuts"] = cuts;
}

}  // namespace

json runShop(std::uint64_t seed, int number) {
  Shop shop(seed, number);
  const std::vector<FleetObservation> observations = shop.history();
  json line{{"case", number}, {"records", observations.size()}};
  firstCuts(shop, observations, &line);
  oddMachines(shop, observations, &line);
  return line;
}

}  // namespace smartmill::loadmeter
