// Dunwoody chapter 6: stability charts.

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "hammer/offset_cases.h"
#include "plant/machine.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/oblique.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"
#include "smartmill_stability/chart/chart_parameters.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::studies {
namespace {

using Rows = std::vector<std::vector<double>>;

constexpr double SLOWEST = 3000.0, FASTEST = 20000.0;  // [rpm]
constexpr double KT = 936e6;                           // [N/m2] eq. 3.22
constexpr int TEETH = 4;

std::vector<double> speeds() {
  std::vector<double> all;
  for (double rpm = SLOWEST; rpm <= FASTEST; rpm += 20.0) all.push_back(units::radPerSecFromRpm(rpm));
  return all;
}

stability::RegenerativeProcess slot(double kt, double radial) {
  return {TEETH, 0.0, units::PI, kt, radial};
}

double least(const StabilityLimit& limit) {
  return *std::min_element(limit.depth.begin(), limit.depth.end());
}

/// [rpm] of the deepest point between two speeds.
double pocket(const StabilityLimit& limit, double from, double to) {
  double deepest = 0.0, at = std::nan("");
  for (std::size_t i = 0; i < limit.depth.size(); ++i) {
    const double rpm = units::rpmFromRadPerSec(limit.spindle_speed[i]);
    if (rpm < from || rpm > to || limit.depth[i] <= deepest) continue;
    deepest = limit.depth[i];
    at = rpm;
  }
  return at;
}

void draw(const std::string& png, const std::vector<StabilityLimit>& limits,
          const std::vector<std::string>& names) {
  Rows rows;
  for (std::size_t i = 0; i < limits[0].depth.size(); ++i) {
    rows.push_back({units::rpmFromRadPerSec(limits[0].spindle_speed[i])});
    for (const StabilityLimit& limit : limits) rows.back().push_back(1e3 * limit.depth[i]);
  }
  const char* styles[] = {"lw 4 lc rgb '#b0b0b0'", "lw 1.5 lc rgb '#c08040'", "lw 1.5 lc rgb '#2060c0'"};
  Gnuplot plot(png, 900, 500, 12);
  plot.block("rows", rows);
  plot << "set grid\nset key above horizontal samplen 2\nset xlabel 'spindle speed [rpm]'\nset ylabel 'limit "
          "of a slot [mm]'\nset yrange [0:*]\n";
  for (std::size_t k = 0; k < limits.size(); ++k)
    plot << (k == 0 ? "plot" : ",") << " $rows using 1:" << k + 2 << " with lines " << styles[k] << " title "
         << Gnuplot::quoted(names[k]);
  plot << "\n";
  plot.draw();
}

/// Figure 6.2: radial ratio 0.25 and 0.5.
Drawn radialRatio(const std::string& folder, unsigned) {
  constexpr double LIMIT = 6e-3;  // [m] of a slot with Kr 0.25, in the figure
  // The thesis prints no FRF: a spindle mode and a tool mode, as stiff as the printed limit demands.
  ModalModel tip;
  tip.modes = {{720.0, 0.035, 1.0 / 70e6}, {2400.0, 0.02, 1.0 / 38e6}};
  const auto responseTo = [&] { return stability::responseOf(tip, tip, 50.0, 6000.0, 4000); };
  const double stiffer = LIMIT / stability::absoluteDepthLimit(slot(KT, 0.25), responseTo());
  for (Mode& mode : tip.modes) mode.gain /= stiffer;
  const auto response = responseTo();
  std::vector<StabilityLimit> limits;
  for (const double radial : {0.25, 0.5})
    limits.push_back(stability::zeroOrderLimit(slot(KT, radial), response, speeds()));
  const std::string png = folder + "/dunwoody_6_2.png";
  draw(png, limits, {"Kr 0.25", "Kr 0.5"});
  const auto size = [](const StabilityLimit& limit) { return 1e3 * least(limit); };
  const double first = pocket(limits[0], 6000.0, 14000.0), second = pocket(limits[1], 6000.0, 14000.0);
  return {
      {png},
      {compareNumber(Kind::restated, "least limit of a slot with Kr 0.25, figure 6.2 [mm]", 1e3 * LIMIT,
                     size(limits[0]), 0.0, 0.02,
                     formatted("put in: the tool mode has %.0f N/um, that of the spindle %.0f; the thesis "
                               "prints no FRF",
                               units::UM / tip.modes[1].gain, units::UM / tip.modes[0].gain)),
       compareNumber(Kind::reproduced, "least limit of a slot with Kr 0.5, figure 6.2 [mm]", 1e3 * LIMIT,
                     size(limits[1]), 0.0, 0.10, "the same tool; x and y are equal here"),
       {Kind::reproduced, "speed of the deepest pocket, 6,000 .. 14,000 rpm, with Kr 0.5 over Kr 0.25",
        "\"very similar\"", formatted("%.3f", second / first),
        std::abs(second / first - 1.0) < 0.05 ? Verdict::agrees : Verdict::differs, ""}}};
}

/// A machine that shares no code with the product (plant/), what its user states of it, and its material.
struct Shop {
  OffsetCase tap;  ///< tool in its spindle, at the hammer station
  ToolGeometry tool;
  loadmeter::ShearZone material;  ///< of the database; this batch deviates
  CuttingCoefficients cutting;    ///< of this batch
};

constexpr double RAKE = 0.14;            // [rad] of every tool
constexpr double METER_TOO_HIGH = 1.11;  // [1] V/W of the machine over the stated ones: eq. 3.20 over 3.22
constexpr double BATCH = 0.03;           // [1] scatter of a coefficient, the model error of the database

Shop drawShop(std::mt19937_64& random) {
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::normal_distribution<double> normal;
  Shop shop;
  shop.tap = drawOffsetCase(random);
  shop.tool = {TEETH, shop.tap.believed.diameter.value, units::radFromDeg(30.0), {}};
  shop.material = {between(250e6, 600e6), units::radFromDeg(between(28.0, 40.0)),
                   units::radFromDeg(between(20.0, 35.0))};
  shop.cutting = loadmeter::obliqueCoefficients(shop.material, RAKE, shop.tool.helix);
  for (double* k : {&shop.cutting.ktc, &shop.cutting.krc, &shop.cutting.kac})
    *k *= 1.0 + BATCH * normal(random);
  shop.cutting.kte = between(10e3, 30e3);
  return shop;
}

/// [N/m2] by the load meter of the machine, from its air cuts and slots. The spindle is stated but for its
/// V/W. The thesis gives no cause of its 11 %: a slope wrong by a share is one of V/W, since friction shifts
/// the intercept only. All powers are then too high by the same share, so that no record shows it.
double ktcByLoadMeter(const Shop& shop, std::mt19937_64& random) {
  MachineModel stated;
  stated.file = "figure 6.3";
  stated.tool = shop.tool;
  stated.spindle.emplace();
  stated.spindle->viscous = 3.7e-4;
  stated.spindle->coulomb = 0.05;
  stated.spindle->load_meter_gain = 3.88e-4;
  stated.spindle->load_meter_bandwidth = 7.0;
  stated.spindle->load_meter_resolution = 3e-4;
  plant::Plant machine;
  machine.tool = shop.tool;
  machine.cutting = shop.cutting;
  machine.spindle = stated.spindle;
  machine.spindle->load_meter_gain *= METER_TOO_HIGH;
  machine.spindle->viscous *= std::uniform_real_distribution<double>(0.8, 1.2)(random);
  plant::RunOptions options;
  options.slice = 0.25e-3;
  std::vector<loadmeter::TestRecord> tests;
  const auto cut = [&](double rpm, double depth, double feed) {
    loadmeter::TestRecord one;
    one.test.name = formatted("test%zu", tests.size());
    one.test.kind = depth > 0.0 ? TestKind::cut : TestKind::air;
    one.test.sample_rate = 2000.0;
    one.test.spindle_speed = units::radPerSecFromRpm(rpm);
    if (depth > 0.0) {
      one.test.engagement = Engagement{0.0, units::PI, depth, feed};
      one.test.engage_time = 0.02;
    }
    one.record = plant::run(machine, one.test, options, random);
    one.record.file = one.test.name;
    tests.push_back(one);
  };
  for (const double rpm : {2000.0, 3000.0, 4500.0, 6000.0, 8000.0, 10000.0}) cut(rpm, 0.0, 0.0);
  // 2.5 N m: "between 2-3 Nm".
  const double depth =
      2.5 / (shop.tool.radius() * TEETH * (shop.cutting.ktc * 1e-4 / units::PI + shop.cutting.kte / 2.0));
  for (const double rpm : {3000.0, 4500.0})
    for (const double feed : {4e-5, 7e-5, 1.0e-4, 1.3e-4}) cut(rpm, depth, feed);
  return loadmeter::identifyFromLoadRecords(tests, stated, {}, stated.file).set.value.ktc;
}

/// Tangential and radial coefficients of the database for this tool, from two others in the material.
CuttingCoefficients fromDatabase(const Shop& shop, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::vector<loadmeter::ObliqueSet> sets;
  for (const double helix : {35.0, 45.0}) {
    loadmeter::ObliqueSet set;
    set.rake = RAKE;
    set.inclination = units::radFromDeg(helix);
    set.value = loadmeter::obliqueCoefficients(shop.material, set.rake, set.inclination);
    set.std_dev = {BATCH * set.value.ktc, BATCH * set.value.krc, BATCH * set.value.kac, NAN, NAN, NAN};
    for (double* k : {&set.value.ktc, &set.value.krc, &set.value.kac}) *k *= 1.0 + BATCH * normal(random);
    set.value.kte = set.value.kre = set.value.kae = NAN;
    sets.push_back(set);
  }
  return loadmeter::predict(loadmeter::semiInverse(sets), RAKE, shop.tool.helix).value;
}

/// Charts of one machine; both sides measure, neither is given the truth.
struct Chain {
  StabilityLimit art;     ///< tap at the tip, coefficients of the database
  StabilityLimit thesis;  ///< hammer station with eq. 4.44, load meter, Kr by the product's rule
  StabilityLimit ours;    ///< hammer station at two heights, the same coefficients
  StabilityLimit truth;
  double ktc = 0.0;        ///< [1] by the load meter over the true one
  double frequency = 0.0;  ///< [Hz] of the chatter at the least limit
};

Chain chainOf(std::mt19937_64& random) {
  constexpr double NOISE = 0.005;  // [1] of the FRF's RMS
  const Shop shop = drawShop(random);
  const OffsetOutcome outcome = judgeOffset(shop.tap, NOISE, random);
  const FrequencyResponse tap = crossFrf(shop.tap.truth, 0.0, 0.0, NOISE, random);
  const auto limitOf = [](const FrequencyResponse& frf, double kt, double radial) {
    return stability::zeroOrderLimit(slot(kt, radial), stability::responseOf(frf, frf), speeds());
  };
  const auto frfOf = [&](TipMethod w) -> const FrequencyResponse& {
    return outcome.frf[static_cast<int>(w)];
  };
  const CuttingCoefficients database = fromDatabase(shop, random);
  const double ktc = ktcByLoadMeter(shop, random);
  const double rule = stability::ChartParameters{}.radial_ratio;  // while Krc is not identified
  Chain chain;
  chain.art = limitOf(tap, database.ktc, database.krc / database.ktc);
  chain.thesis = limitOf(frfOf(TipMethod::thesis), ktc, rule);
  chain.ours = limitOf(frfOf(TipMethod::two_heights), ktc, rule);
  chain.truth = limitOf(outcome.truth, shop.cutting.ktc, shop.cutting.krc / shop.cutting.ktc);
  chain.ktc = ktc / shop.cutting.ktc;
  const auto lowest = std::min_element(chain.truth.depth.begin(), chain.truth.depth.end());
  chain.frequency =
      chain.truth.chatter_frequency[static_cast<std::size_t>(lowest - chain.truth.depth.begin())];
  return chain;
}

/// [1] largest difference at any speed, of the depths that a chart shows.
double widestOff(const StabilityLimit& limit, const StabilityLimit& reference) {
  const double shown = stability::ChartParameters{}.max_depth;
  double most = 0.0;
  for (std::size_t i = 0; i < reference.depth.size(); ++i) {
    const double depth = std::min(limit.depth[i], shown), expected = std::min(reference.depth[i], shown);
    most = std::max(most, std::abs(depth / expected - 1.0));
  }
  return most;
}

/// Figure 6.3 (and 4.8): the automatic chain of hammer station and load meter, compared with a tap test at
/// the tip and coefficients of a database.
Drawn automaticChain(const std::string& folder, unsigned seed, std::size_t machines) {
  constexpr double HIGHEST = 5000.0;  // [Hz] of the hammer's band
  constexpr double SAME = 0.05;       // [1] of the speed of a pocket
  std::mt19937_64 random(seed);
  std::vector<Chain> chains;
  for (std::size_t i = 0; i < machines; ++i) chains.push_back(chainOf(random));
  const auto off = [](const StabilityLimit& limit, const StabilityLimit& reference) {
    return std::abs(least(limit) / least(reference) - 1.0);
  };
  const auto ratioOf = [](const Chain& c) { return least(c.ours) / least(c.art); };
  std::sort(chains.begin(), chains.end(),
            [&](const Chain& a, const Chain& b) { return ratioOf(a) < ratioOf(b); });
  std::vector<double> theirs, mine, true_art, true_mine, ktc, ratio, widest, theirs_widest;
  std::size_t beyond = 0, same = 0;
  for (const Chain& c : chains) {
    theirs.push_back(100.0 * off(c.thesis, c.art));
    mine.push_back(100.0 * off(c.ours, c.art));
    true_art.push_back(100.0 * off(c.art, c.truth));
    true_mine.push_back(100.0 * off(c.ours, c.truth));
    ktc.push_back(c.ktc);
    ratio.push_back(ratioOf(c));
    widest.push_back(100.0 * widestOff(c.ours, c.art));
    theirs_widest.push_back(100.0 * widestOff(c.thesis, c.art));
    beyond += c.frequency > HIGHEST;
    const double at = pocket(c.art, 6000.0, FASTEST), spread = 0.15 * at;
    same += std::abs(pocket(c.ours, at - spread, std::min(at + spread, FASTEST)) / at - 1.0) < SAME;
  }
  const Chain& middle = chains[chains.size() / 2];
  const std::string png = folder + "/dunwoody_6_3.png";
  draw(png, {middle.art, middle.thesis, middle.ours},
       {"tap at the tip, coefficients of a database", "hammer station with eq. 4.44, load meter, Kr 0.3",
        "hammer station at two heights, load meter, Kr 0.3"});
  const auto say = [](const std::vector<double>& e) {
    return formatted("median %.1f %%, 95 %% of machines %.1f %%", percentile(e, 0.5), percentile(e, 0.95));
  };
  return {
      {png},
      {compareNumber(
           Kind::restated,
           formatted("Ktc by the load meter over the true one, median of %zu machines, figure 6.3", machines),
           1.11, percentile(ktc, 0.5), 0.0, 0.03, "put in: the V/W stated of each meter are 11 % too low"),
       {Kind::reproduced,
        formatted(
            "speed of the deepest pocket, automatic chain and state of the art, %zu machines, figure 6.3",
            machines),
        "\"comparable\"", formatted("within 5 %% on %zu of %zu", same, machines),
        10 * same >= 9 * machines ? Verdict::agrees : Verdict::differs,
        "all machines that were drawn; the chain is given neither FRF nor coefficients. The median "
        "machine is drawn"},
       compareNumber(
           Kind::reproduced,
           formatted("least limit, automatic chain over state of the art, median of %zu machines, figure 6.3",
                     machines),
           936.0 / 1040.0, percentile(ratio, 0.5), 0.0, stability::ChartParameters{}.gain_std,
           formatted(
               "a limit is inverse to Ktc: eq. 3.22 over 3.20, within the deviation of a gain as shipped. "
               "Off the state of the art: here %s, with eq. 4.44 %s; at the worst speed, to 20 mm (they: "
               "\"varies widely at certain spindle speeds\"): here %s, with eq. 4.44 %s. Off the true "
               "limit: state of the art %s, chain %s. %zu machines are limited by a mode beyond 5 kHz, the "
               "end of the hammer's band",
               say(mine).c_str(), say(theirs).c_str(), say(widest).c_str(), say(theirs_widest).c_str(),
               say(true_art).c_str(), say(true_mine).c_str(), beyond))}};
}

}  // namespace

std::vector<Figure> chartFigures() {
  return {{"dunwoody_6_2", "Dunwoody figure 6.2: charts with two radial ratios", radialRatio},
          {"dunwoody_6_3", "Dunwoody figure 6.3: the automatic chain and the state of the art",
           [](const std::string& folder, unsigned seed) { return automaticChain(folder, seed, 40); },
           [](const std::string& folder, unsigned seed) { return automaticChain(folder, seed, 6); }}};
}

}  // namespace smartmill::studies
