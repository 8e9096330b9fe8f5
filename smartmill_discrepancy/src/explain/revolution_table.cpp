#include "smartmill_discrepancy/explain/revolution_table.h"

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

struct RevolutionTableOptions {
  std::size_t min_feeds = 3;  ///< two determine a linear table; the third tests it
  double alike = 0.01;        ///< [1] tolerance of speed, depth and feed
};

const RevolutionTableOptions LIMITS;

// Residual lines of one force of one cut.
struct CutResidual {
  double chips = 0.0;  // [1] feed per tooth over the largest
  Repeatability lines;
};

struct FeedTrend {
  double constant = 0.0, slope = 0.0;  // [N]
  double gain = 0.0;                   // reduction of squares over those of the asynchronous part
};

bool alike(double a, double b) {
  return std::abs(a - b) <= LIMITS.alike * std::abs(b);
}

bool sameButFeed(const CampaignTest& a, const CampaignTest& b) {
  return alike(a.spindle_speed, b.spindle_speed) &&
         alike(a.engagement->axial_depth, b.engagement->axial_depth) &&
         a.engagement->entry == b.engagement->entry && a.engagement->exit == b.engagement->exit &&
         a.feed_direction == b.feed_direction;
}

// By force channel, without the curvature. Entry and the initial transient of the sensor are omitted.
std::map<std::string, std::vector<CutResidual>> residualsOf(const TwinRunner& runner, const FitResult& now,
                                                            const std::vector<std::size_t>& cuts,
                                                            double largest_chip,
                                                            const FeedCurvature& curvature) {
  std::map<std::string, std::vector<CutResidual>> residuals;
  for (const ChannelSpan& b : runner.spans()) {
    if (b.slow || std::find(FORCES.begin(), FORCES.end(), b.channel) == FORCES.end() ||
        std::find(cuts.begin(), cuts.end(), b.test) == cuts.end())
      continue;
    const TestData& test = runner.data().tests[b.test];
    std::vector<double> residual = valuesOf(now.residual, b);
    for (double& v : residual) v *= b.noise;
    auto lines = steadyRepeatability(test, residual);
    if (!lines) continue;
    const double chip = test.test.engagement->feed_per_tooth;
    for (const auto& [order, channels] : curvature.orders) {
      const auto [cosine, sine] = curvature.at(order, b.channel, chip);
      const auto k = static_cast<std::size_t>(order);
      if (2 * k >= lines->lines.size()) continue;
      lines->lines[k == 0 ? 0 : 2 * k - 1] -= cosine;
      if (k > 0) lines->lines[2 * k] -= sine;
    }
    residuals[b.channel].push_back({chip / largest_chip, *lines});
  }
  return residuals;
}

// Weighted linear fit over the feed. A cosine or sine has half the power of a mean.
FeedTrend feedTrendOf(const std::vector<CutResidual>& residuals, std::size_t line) {
  double w = 0.0, x = 0.0, xx = 0.0, y = 0.0, xy = 0.0;
  for (const CutResidual& r : residuals) {
    const double weight =
        static_cast<double>(r.lines.samples) * (line == 0 ? 1.0 : 0.5) / (r.lines.floor * r.lines.floor);
    const double value = line < r.lines.lines.size() ? r.lines.lines[line] : 0.0;
    w += weight;
    x += weight * r.chips;
    xx += weight * r.chips * r.chips;
    y += weight * value;
    xy += weight * r.chips * value;
  }
  FeedTrend trend;
  trend.slope = (w * xy - x * y) / (w * xx - x * x);
  trend.constant = (y - trend.slope * x) / w;
  trend.gain = trend.constant * y + trend.slope * xy;
  return trend;
}

// Mean or cosine, and sine of an order, of one channel.
using OrderTrend = std::array<FeedTrend, 2>;
using OrderTable = std::map<double, std::map<std::string, OrderTrend>>;  // by order and channel

double gainOf(const std::map<std::string, OrderTrend>& channels) {
  double gain = 0.0;
  for (const auto& [channel, order] : channels) gain += order[0].gain + order[1].gain;
  return gain;
}

// Orders that gain more than their values cost.
// @param cost [squares] of a value
OrderTable orderTableOf(const std::map<std::string, std::vector<CutResidual>>& residuals, double cost) {
  std::size_t count = 0;
  for (const auto& [channel, of_tests] : residuals) {
    for (const CutResidual& r : of_tests) count = std::max(count, r.lines.lines.size());
  }
  OrderTable lines;
  for (std::size_t k = 0; 2 * k < count; ++k) {
    std::map<std::string, OrderTrend> channels;
    for (const auto& [channel, of_tests] : residuals) {
      OrderTrend& order = channels[channel];
      order[0] = feedTrendOf(of_tests, k == 0 ? 0 : 2 * k - 1);
      if (k > 0) order[1] = feedTrendOf(of_tests, 2 * k);
    }
    if (gainOf(channels) > cost * static_cast<double>(4 * channels.size()))
      lines[static_cast<double>(k)] = std::move(channels);
  }
  return lines;
}

bool isTable(const Hypothesis& h) {
  return h.effect == std::string(EMPIRICAL) + ":revolution";
}

// Adds the values of an existing table.
void addTable(const Member& member, OrderTable* lines) {
  const EffectEntry entry = member.hypothesis->entry(member.values);
  const std::vector<double>& orders = entry.lists.at("order");
  for (std::size_t k = 0; k < orders.size(); ++k) {
    for (const std::string& channel : FORCES) {
      const double* const four = &entry.lists.at(channel + "_n")[4 * k];
      OrderTrend& order = (*lines)[orders[k]][channel];
      for (std::size_t part = 0; part < 2; ++part) {
        order[part].constant += member.values[0] * four[part];
        order[part].slope += member.values[0] * four[2 + part];
      }
    }
  }
}

// Curvature of a table, scaled by its share.
FeedCurvature curvatureOf(const Member& member) {
  const EffectEntry entry = member.hypothesis->entry(member.values);
  FeedCurvature curvature;
  const auto chips = entry.lists.find("bend_um");
  if (chips == entry.lists.end()) return curvature;
  for (const double chip : chips->second) curvature.chips.push_back(units::UM * chip);
  const std::vector<double>& orders = entry.lists.at("order");
  const std::size_t each = 2 * curvature.chips.size();
  for (std::size_t k = 0; k < orders.size(); ++k) {
    for (const std::string& channel : FORCES) {
      std::vector<double>& table = curvature.orders[orders[k]][channel];
      const std::vector<double>& all = entry.lists.at(channel + "_bend_n");
      const auto from = all.begin() + static_cast<std::ptrdiff_t>(each * k);
      table.assign(from, from + static_cast<std::ptrdiff_t>(each));
      for (double& v : table) v *= member.values[0];
    }
  }
  return curvature;
}

void writeCurvature(const FeedCurvature& curvature, const std::vector<double>& orders, Hypothesis* table) {
  if (curvature.chips.empty()) return;
  std::vector<double> chips;
  for (const double chip : curvature.chips) chips.push_back(chip / units::UM);
  table->list("bend_um", chips);
  for (const std::string& channel : FORCES) {
    std::vector<double> all;
    for (const double order : orders) {
      const auto found = curvature.orders.find(order);
      const std::vector<double> none(2 * chips.size(), 0.0);
      const std::vector<double>& own = found == curvature.orders.end() ? none : found->second.at(channel);
      all.insert(all.end(), own.begin(), own.end());
    }
    table->list(channel + "_bend_n", all);
  }
}

}  // namespace

std::vector<std::size_t> cutsOfVaryingFeed(const TwinRunner& runner) {
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
  return feeds.size() >= LIMITS.min_feeds ? cuts : std::vector<std::size_t>{};
}

std::optional<Hypothesis> revolutionTable(const TwinRunner& runner, const std::vector<Hypothesis>& all,
                                          const FitResult& now, const FeedCurvature& curvature) {
  const auto form = std::find_if(all.begin(), all.end(), isTable);
  const std::vector<std::size_t> cuts = cutsOfVaryingFeed(runner);
  if (form == all.end() || cuts.empty()) return {};
  double chip = 0.0;
  for (const std::size_t t : cuts)
    chip = std::max(chip, runner.data().tests[t].test.engagement->feed_per_tooth);
  const std::map<std::string, std::vector<CutResidual>> residuals =
      residualsOf(runner, now, cuts, chip, curvature);
  if (std::any_of(residuals.begin(), residuals.end(),
                  [](const auto& r) { return r.second.size() < LIMITS.min_feeds; }))
    return {};
  const double cost = std::log(static_cast<double>(runner.size()));
  OrderTable lines = orderTableOf(residuals, cost);
  const bool extends_table = !now.state.members.empty() && isTable(*now.state.members.back().hypothesis);
  if (extends_table) addTable(now.state.members.back(), &lines);
  for (const auto& [order, channels] : curvature.orders) lines[order];
  if (lines.empty()) return {};
  std::vector<double> orders;
  std::map<std::string, std::vector<double>> tables;
  for (auto& [k, channels] : lines) {
    orders.push_back(k);
    for (const std::string& channel : FORCES) {
      const OrderTrend& order = channels[channel];
      for (const double v : {order[0].constant, order[1].constant, order[0].slope, order[1].slope})
        tables[channel].push_back(v);
    }
  }
  const CampaignTest& test = runner.data().tests[cuts.front()].test;
  Hypothesis table_form = *form;
  table_form.number("speed_rpm", units::rpmFromRadPerSec(test.spindle_speed))
      .number("depth_mm", test.engagement->axial_depth / units::MM)
      .number("chip_um", chip / units::UM)
      .list("order", orders);
  for (const auto& [channel, table] : tables) table_form.list(channel + "_n", table);
  writeCurvature(extends_table && curvature.chips.empty() ? curvatureOf(now.state.members.back()) : curvature,
                 orders, &table_form);
  table_form.probe({0.0}, {{1.0}}).named(formatted("%zu orders", orders.size()));
  table_form.bic_penalty = cost * (4.0 * static_cast<double>(orders.size() * residuals.size()) - 1.0);
  return table_form;
}

bool hasRevolutionTable(const FitState& state) {
  return std::any_of(state.members.begin(), state.members.end(),
                     [](const Member& m) { return isTable(*m.hypothesis); });
}

}  // namespace smartmill::discrepancy
