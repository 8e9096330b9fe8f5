#include "search/probes/mode_probes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "smartmill_core/cutting/contact_arc.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

struct ModeProbeOptions {
  std::size_t angles = 360;  ///< per revolution at which the cutting stiffness is tabulated
  int slices = 24;           ///< of the axial depth, which the helix spreads over the angle
};

const ModeProbeOptions LIMITS;

const std::array<std::string, 2> TIP{{"tool_x", "tool_y"}};

bool actsBehindSensor(const std::string& effect) {
  const EffectKind* kind = findEffect(effect);
  return kind && isBehindSensor(kind->stage);
}

ModalModel oneMode(double frequency, double damping_ratio, double gain) {
  ModalModel m;
  Mode mode;
  mode.frequency = frequency;
  mode.damping_ratio = damping_ratio;
  mode.gain = gain;
  m.modes.push_back(mode);
  return m;
}

// Independent filters, interleaved for throughput.
class Filters {
 public:
  Filters(const std::vector<double>& frequencies, double damping_ratio, double rate) {
    for (const double f : frequencies)
      filters_.emplace_back(oneMode(f, damping_ratio, 1.0), rate, Hold::first_order);
  }
  Filters(const ModalModel& all, std::size_t count, double rate)
      : filters_(count, ModalFilter(all, rate, Hold::first_order)) {}

  /// The same input for all filters.
  void step(double input, double* output) {
    for (std::size_t k = 0; k < filters_.size(); ++k) output[k] = filters_[k].step(input);
  }
  /// One input per filter, replaced by its output.
  void step(double* values) {
    for (std::size_t k = 0; k < filters_.size(); ++k) values[k] = filters_[k].step(values[k]);
  }

 private:
  std::vector<ModalFilter> filters_;
};

}  // namespace

// Tip displacement of one test: one row per sample, one value per frequency.
struct ModeProbes::TipDisplacement {
  std::size_t count = 0;
  std::vector<double> at;

  const double* row(std::size_t i) const { return at.data() + i * count; }
};

ModeProbes::ModeProbes(const TwinRunner& runner, const MachineModel& model, std::vector<Eigen::Index> samples)
    : runner_(runner), model_(model), samples_(std::move(samples)) {
  MachineModel ideal = model;
  for (ModalModel& axis : ideal.force_sensor.axis) {
    axis = ModalModel{};
    axis.direct = 1.0;
  }
  ideal.effects.clear();
  for (const EffectEntry& e : model.effects) {
    if (!actsBehindSensor(e.name)) ideal.effects.push_back(e);
  }
  applied_ = runner.simulate(ideal);
  for (const std::size_t t : runner.tests()) {
    const CampaignTest& test = runner.data().tests[t].test;
    if (test.kind == TestKind::cut) stiffness_[t] = cuttingStiffness(test);
  }
}

std::vector<ModeProbes::Stiffness> ModeProbes::cuttingStiffness(const CampaignTest& test) const {
  const Engagement& engagement = *test.engagement;
  const std::vector<ContactArc> arcs = contactArcs(engagement, test.feed_direction);
  const ToolGeometry& tool = *model_.tool;
  const CuttingCoefficients& k = *model_.cutting;
  const double dz = engagement.axial_depth / LIMITS.slices;
  const std::size_t points = LIMITS.angles;
  std::vector<Stiffness> table(points, Stiffness{});
  for (std::size_t p = 0; p < points; ++p) {
    for (int j = 0; j < tool.teeth; ++j) {
      for (int s = 0; s < LIMITS.slices; ++s) {
        const double tip =
            units::TWO_PI * static_cast<double>(p) / static_cast<double>(points) + tool.toothAngle(j);
        double phi = std::fmod(tip - tool.lag() * (s + 0.5) * dz, units::TWO_PI);
        if (phi < 0.0) phi += units::TWO_PI;
        if (std::none_of(arcs.begin(), arcs.end(),
                         [&](const ContactArc& arc) { return phi >= arc.entry && phi < arc.exit; }))
          continue;
        const double sn = std::sin(phi), cs = std::cos(phi);
        const CuttingForce f = toolForce(k.ktc * dz, k.krc * dz, k.kac * dz, phi, tool.radius());
        const std::array<double, 3> force{{f.fx, f.fy, f.fz}};
        for (std::size_t a = 0; a < 3; ++a) {
          table[p][a][0] += force[a] * sn;
          table[p][a][1] += force[a] * cs;
        }
      }
    }
  }
  return table;
}

template <class Function>
void ModeProbes::forEachSampleIn(const ChannelSpan& block, const Function& function) const {
  const auto begin = static_cast<Eigen::Index>(block.offset);
  auto next = std::lower_bound(samples_.begin(), samples_.end(), begin);
  for (; next != samples_.end() && *next < begin + static_cast<Eigen::Index>(block.size); ++next)
    function(static_cast<std::size_t>(*next - begin), next - samples_.begin());
}

Eigen::MatrixXd ModeProbes::sensorModes(std::size_t axis, const std::vector<double>& frequencies,
                                        double damping_ratio) const {
  const auto count = static_cast<Eigen::Index>(frequencies.size());
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(samples_.size()), count);
  Eigen::RowVectorXd response(count);
  for (const ChannelSpan& b : runner_.spans()) {
    if (b.channel != FORCES[axis]) continue;
    Filters filters(frequencies, damping_ratio, runner_.data().tests[b.test].test.sample_rate);
    std::size_t at = 0;
    forEachSampleIn(b, [&](std::size_t i, Eigen::Index row) {
      for (; at <= i; ++at) filters.step(applied_[b.offset + at], response.data());
      columns.row(row) = response.array() - applied_[b.offset + i];
    });
  }
  return columns;
}

// Spans first..end are those of one test. Empty if the test has no force on the tip.
ModeProbes::TipDisplacement ModeProbes::tipDisplacement(std::size_t first, std::size_t end, std::size_t axis,
                                                        const std::vector<double>& frequencies,
                                                        double damping_ratio) const {
  const std::vector<ChannelSpan>& blocks = runner_.spans();
  const TestData& data = runner_.data().tests[blocks[first].test];
  Filters tip(frequencies, damping_ratio, data.test.sample_rate);
  TipDisplacement result{frequencies.size(), {}};
  const auto push = [&](double force) {
    result.at.resize(result.at.size() + result.count);
    tip.step(force, result.at.data() + result.at.size() - result.count);
  };
  if (data.test.kind == TestKind::tap && data.record.has(TIP[axis]) &&
      data.test.direction == (axis == 0 ? "x" : "y")) {
    for (const double f : data.record.column("hammer")) push(f);
  }
  for (std::size_t b = first; b < end && data.test.kind == TestKind::cut; ++b) {
    if (blocks[b].channel != FORCES[axis]) continue;
    for (std::size_t i = 0; i < blocks[b].size; ++i) push(applied_[blocks[b].offset + i] * blocks[b].noise);
  }
  return result;
}

// Forces of the chip thickness between the current displacement and that one tooth period earlier.
void ModeProbes::addRegeneration(std::size_t first, std::size_t end, std::size_t axis,
                                 const TipDisplacement& tip, Eigen::MatrixXd* columns) const {
  const std::vector<ChannelSpan>& blocks = runner_.spans();
  const TestData& data = runner_.data().tests[blocks[first].test];
  const double rate = data.test.sample_rate;
  const std::vector<Stiffness>& table = stiffness_.at(blocks[first].test);
  const double period = units::TWO_PI / model_.tool->teeth / data.test.spindle_speed * rate;  // [samples]
  const std::vector<double>& angle = data.record.column("spindle_angle");
  const auto points = static_cast<double>(table.size());
  Eigen::RowVectorXd force(columns->cols());
  for (std::size_t b = first; b < end; ++b) {
    const auto a =
        static_cast<std::size_t>(std::find(FORCES.begin(), FORCES.end(), blocks[b].channel) - FORCES.begin());
    if (a >= 3) continue;
    Filters sensor(model_.force_sensor.axis[a], tip.count, rate);
    const auto step = [&](std::size_t i) {
      force.setZero();
      const double before = static_cast<double>(i) - period;
      const auto n = static_cast<std::size_t>(std::max(before, 0.0));
      const double share = before - static_cast<double>(n);
      const auto p = static_cast<std::size_t>(angle[i] / units::TWO_PI * points) % table.size();
      for (std::size_t k = 0; k < tip.count && i >= data.first_cut; ++k) {
        const double past = before > 0.0 ? (1.0 - share) * tip.row(n)[k] + share * tip.row(n + 1)[k] : 0.0;
        force[static_cast<Eigen::Index>(k)] = table[p][a][axis] * (tip.row(i)[k] - past);
      }
      sensor.step(force.data());
    };
    std::size_t at = 0;
    forEachSampleIn(blocks[b], [&](std::size_t i, Eigen::Index row) {
      for (; at <= i; ++at) step(at);
      columns->row(row) = force / blocks[b].noise;
    });
  }
}

Eigen::MatrixXd ModeProbes::tipModes(std::size_t axis, const std::vector<double>& frequencies,
                                     double damping_ratio) const {
  const auto count = static_cast<Eigen::Index>(frequencies.size());
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(samples_.size()), count);
  const std::vector<ChannelSpan>& blocks = runner_.spans();
  for (std::size_t first = 0, end = 0; first < blocks.size(); first = end) {
    while (end < blocks.size() && blocks[end].test == blocks[first].test) ++end;
    const TipDisplacement tip = tipDisplacement(first, end, axis, frequencies, damping_ratio);
    if (tip.at.empty()) continue;
    for (std::size_t b = first; b < end; ++b) {
      if (blocks[b].channel != TIP[axis]) continue;
      forEachSampleIn(blocks[b], [&](std::size_t i, Eigen::Index row) {
        columns.row(row) = Eigen::Map<const Eigen::RowVectorXd>(tip.row(i), count) / blocks[b].noise;
      });
    }
    const TestData& data = runner_.data().tests[blocks[first].test];
    if (data.test.kind == TestKind::cut && data.record.has("spindle_angle"))
      addRegeneration(first, end, axis, tip, &columns);
  }
  return columns;
}

}  // namespace smartmill::discrepancy
