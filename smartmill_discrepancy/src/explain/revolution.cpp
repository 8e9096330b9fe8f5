#include "smartmill_discrepancy/explain/revolution.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>

#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/gap/repeatability.h"

namespace smartmill::discrepancy {
namespace {

constexpr std::size_t LEAST_FEEDS = 3;
constexpr double ALIKE = 0.01;  // by which speed, depth and feed of cuts may differ

// What is left of one force of one cut, line by line.
struct Rest {
  double chips = 0.0;  // [1] feed per tooth over the largest
  Repeatability lines;
};

struct Course {
  double always = 0.0, growing = 0.0;  // [N]
  double gain = 0.0;                   // squares over what does not come again
};

bool alike(double a, double b) {
  return std::abs(a - b) <= ALIKE * std::abs(b);
}

bool sameButFeed(const CampaignTest& a, const CampaignTest& b) {
  return alike(a.spindle_speed, b.spindle_speed) &&
         alike(a.engagement->axial_depth, b.engagement->axial_depth) &&
         a.engagement->entry == b.engagement->entry && a.engagement->exit == b.engagement->exit;
}

std::vector<double> part(const std::vector<double>& all, std::size_t from, std::size_t to) {
  return {all.begin() + static_cast<std::ptrdiff_t>(from), all.begin() + static_cast<std::ptrdiff_t>(to)};
}

// By force channel, beside a bend. Entry and the sensor's first ringing are left out.
std::map<std::string, std::vector<Rest>> restsOf(const TwinRunner& runner, const Fit& now,
                                                 const std::vector<std::size_t>& cuts, double largest_chip,
                                                 const Bend& bend) {
  std::map<std::string, std::vector<Rest>> rests;
  for (const Block& b : runner.blocks()) {
    if (b.slow || std::find(FORCES.begin(), FORCES.end(), b.channel) == FORCES.end() ||
        std::find(cuts.begin(), cuts.end(), b.test) == cuts.end())
      continue;
    const TestData& test = runner.data().tests[b.test];
    const std::size_t from = test.first_cut + (b.size - test.first_cut) / 8;
    std::vector<double> left = part(now.residual, b.offset + from, b.offset + b.size);
    for (double& v : left) v *= b.noise;
    auto lines = repeatability(left, part(test.record.column("spindle_angle"), from, b.size));
    if (!lines) continue;
    const double chip = test.test.engagement->feed_per_tooth;
    for (const auto& [order, channels] : bend.orders) {
      const auto [cosine, sine] = bend.at(order, b.channel, chip);
      const auto k = static_cast<std::size_t>(order);
      if (2 * k >= lines->lines.size()) continue;
      lines->lines[k == 0 ? 0 : 2 * k - 1] -= cosine;
      if (k > 0) lines->lines[2 * k] -= sine;
    }
    rests[b.channel].push_back({chip / largest_chip, *lines});
  }
  return rests;
}

// Straight over the feed, by least squares. A cosine or sine holds half the power of a level.
Course courseOf(const std::vector<Rest>& rests, std::size_t line) {
  double w = 0.0, x = 0.0, xx = 0.0, y = 0.0, xy = 0.0;
  for (const Rest& r : rests) {
    const double weight =
        static_cast<double>(r.lines.samples) * (line == 0 ? 1.0 : 0.5) / (r.lines.floor * r.lines.floor);
    const double value = line < r.lines.lines.size() ? r.lines.lines[line] : 0.0;
    w += weight;
    x += weight * r.chips;
    xx += weight * r.chips * r.chips;
    y += weight * value;
    xy += weight * r.chips * value;
  }
  Course course;
  course.growing = (w * xy - x * y) / (w * xx - x * x);
  course.always = (y - course.growing * x) / w;
  course.gain = course.always * y + course.growing * xy;
  return course;
}

// Level or cosine, and sine of an order, of one channel.
using Order = std::array<Course, 2>;
using Lines = std::map<double, std::map<std::string, Order>>;  // by order and channel

double gainOf(const std::map<std::string, Order>& channels) {
  double gain = 0.0;
  for (const auto& [channel, order] : channels) gain += order[0].gain + order[1].gain;
  return gain;
}

// Orders that tell more than their numbers cost.
// @param cost [squares] of a number
Lines linesOf(const std::map<std::string, std::vector<Rest>>& rests, double cost) {
  std::size_t count = 0;
  for (const auto& [channel, of_tests] : rests) {
    for (const Rest& r : of_tests) count = std::max(count, r.lines.lines.size());
  }
  Lines lines;
  for (std::size_t k = 0; 2 * k < count; ++k) {
    std::map<std::string, Order> channels;
    for (const auto& [channel, of_tests] : rests) {
      Order& order = channels[channel];
      order[0] = courseOf(of_tests, k == 0 ? 0 : 2 * k - 1);
      if (k > 0) order[1] = courseOf(of_tests, 2 * k);
    }
    if (gainOf(channels) > cost * static_cast<double>(4 * channels.size()))
      lines[static_cast<double>(k)] = std::move(channels);
  }
  return lines;
}

bool isTable(const Hypothesis& h) {
  return h.effect == std::string(EMPIRICAL) + ":revolution";
}

// What a state's table says of each order already is added.
void addTable(const Member& member, Lines* lines) {
  const EffectEntry entry = member.hypothesis->entry(member.values);
  const std::vector<double>& orders = entry.lists.at("order");
  for (std::size_t k = 0; k < orders.size(); ++k) {
    for (const std::string& channel : FORCES) {
      const double* const four = &entry.lists.at(channel + "_n")[4 * k];
      Order& order = (*lines)[orders[k]][channel];
      for (std::size_t part = 0; part < 2; ++part) {
        order[part].always += member.values[0] * four[part];
        order[part].growing += member.values[0] * four[2 + part];
      }
    }
  }
}

// The bend of a table, with its share.
Bend bendOf(const Member& member) {
  const EffectEntry entry = member.hypothesis->entry(member.values);
  Bend bend;
  const auto chips = entry.lists.find("bend_um");
  if (chips == entry.lists.end()) return bend;
  for (const double chip : chips->second) bend.chips.push_back(units::UM * chip);
  const std::vector<double>& orders = entry.lists.at("order");
  const std::size_t each = 2 * bend.chips.size();
  for (std::size_t k = 0; k < orders.size(); ++k) {
    for (const std::string& channel : FORCES) {
      std::vector<double>& table = bend.orders[orders[k]][channel];
      const std::vector<double>& all = entry.lists.at(channel + "_bend_n");
      table = part(all, each * k, each * (k + 1));
      for (double& v : table) v *= member.values[0];
    }
  }
  return bend;
}

void place(const Bend& bend, const std::vector<double>& orders, Hypothesis* table) {
  if (bend.chips.empty()) return;
  std::vector<double> chips;
  for (const double chip : bend.chips) chips.push_back(chip / units::UM);
  table->list("bend_um", chips);
  for (const std::string& channel : FORCES) {
    std::vector<double> all;
    for (const double order : orders) {
      const auto found = bend.orders.find(order);
      const std::vector<double> none(2 * chips.size(), 0.0);
      const std::vector<double>& own = found == bend.orders.end() ? none : found->second.at(channel);
      all.insert(all.end(), own.begin(), own.end());
    }
    table->list(channel + "_bend_n", all);
  }
}

}  // namespace

std::vector<std::size_t> cutsOfOneKind(const TwinRunner& runner) {
  std::vector<std::size_t> cuts;
  std::vector<double> feeds;
  for (const std::size_t t : runner.tests()) {
    const TestData& data = runner.data().tests[t];
    if (data.test.kind != TestKind::cut || data.chatter) continue;
    if (!data.record.has("spindle_angle")) return {};
    if (!cuts.empty() && !sameButFeed(data.test, runner.data().tests[cuts.front()].test)) return {};
    cuts.push_back(t);
    const double feed = data.test.engagement->feed_per_tooth;
    if (std::none_of(feeds.begin(), feeds.end(), [&](double f) { return alike(f, feed); }))
      feeds.push_back(feed);
  }
  return feeds.size() >= LEAST_FEEDS ? cuts : std::vector<std::size_t>{};
}

std::optional<Hypothesis> revolutionLeft(const TwinRunner& runner, const std::vector<Hypothesis>& all,
                                         const Fit& now, const Bend& bend) {
  const auto form = std::find_if(all.begin(), all.end(), isTable);
  const std::vector<std::size_t> cuts = cutsOfOneKind(runner);
  if (form == all.end() || cuts.empty()) return {};
  double chip = 0.0;
  for (const std::size_t t : cuts)
    chip = std::max(chip, runner.data().tests[t].test.engagement->feed_per_tooth);
  const std::map<std::string, std::vector<Rest>> rests = restsOf(runner, now, cuts, chip, bend);
  if (std::any_of(rests.begin(), rests.end(), [](const auto& r) { return r.second.size() < LEAST_FEEDS; }))
    return {};
  const double cost = std::log(static_cast<double>(runner.size()));
  Lines lines = linesOf(rests, cost);
  const bool again = !now.state.members.empty() && isTable(*now.state.members.back().hypothesis);
  if (again) addTable(now.state.members.back(), &lines);
  for (const auto& [order, channels] : bend.orders) lines[order];
  if (lines.empty()) return {};
  std::vector<double> orders;
  std::map<std::string, std::vector<double>> tables;
  for (auto& [k, channels] : lines) {
    orders.push_back(k);
    for (const std::string& channel : FORCES) {
      const Order& order = channels[channel];
      for (const double v : {order[0].always, order[1].always, order[0].growing, order[1].growing})
        tables[channel].push_back(v);
    }
  }
  const CampaignTest& test = runner.data().tests[cuts.front()].test;
  Hypothesis placed = *form;
  placed.number("speed_rpm", units::rpmFromRadPerSec(test.spindle_speed))
      .number("depth_mm", test.engagement->axial_depth / units::MM)
      .number("chip_um", chip / units::UM)
      .list("order", orders);
  for (const auto& [channel, table] : tables) placed.list(channel + "_n", table);
  place(again && bend.chips.empty() ? bendOf(now.state.members.back()) : bend, orders, &placed);
  placed.probe({0.0}, {{1.0}}).named(formatted("%zu orders", orders.size()));
  placed.handicap = cost * (4.0 * static_cast<double>(orders.size() * rests.size()) - 1.0);
  return placed;
}

bool hasRevolution(const FitState& state) {
  return std::any_of(state.members.begin(), state.members.end(),
                     [](const Member& m) { return isTable(*m.hypothesis); });
}

}  // namespace smartmill::discrepancy
