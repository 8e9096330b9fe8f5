#include "smartmill_discrepancy/search/mode_probes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

const std::array<std::string, 2> TIP{{"tool_x", "tool_y"}};

constexpr std::size_t POINTS = 360;  // a turn

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

}  // namespace

ModeProbes::ModeProbes(const TwinRunner& runner, const MachineModel& model) : runner_(runner), model_(model) {
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
    if (test.kind == TestKind::cut) stiffness_[t] = cuttingStiffness(model, *test.engagement);
  }
}

std::vector<ModeProbes::Stiffness> ModeProbes::cuttingStiffness(const MachineModel& model,
                                                                const Engagement& engagement) {
  const ToolGeometry& tool = *model.tool;
  const CuttingCoefficients& k = *model.cutting;
  constexpr int SLICES = 24;
  const double dz = engagement.axial_depth / SLICES;
  std::vector<Stiffness> table(POINTS, Stiffness{});
  for (std::size_t p = 0; p < POINTS; ++p) {
    for (int j = 0; j < tool.teeth; ++j) {
      for (int s = 0; s < SLICES; ++s) {
        const double tip =
            units::TWO_PI * static_cast<double>(p) / static_cast<double>(POINTS) + tool.toothAngle(j);
        double phi = std::fmod(tip - tool.lag() * (s + 0.5) * dz, units::TWO_PI);
        if (phi < 0.0) phi += units::TWO_PI;
        if (phi < engagement.entry || phi >= engagement.exit) continue;
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

std::vector<double> ModeProbes::sensorMode(std::size_t axis, double frequency, double damping_ratio) const {
  std::vector<double> column(runner_.size(), 0.0);
  for (const Block& b : runner_.blocks()) {
    if (b.channel != FORCES[axis]) continue;
    ModalFilter filter(oneMode(frequency, damping_ratio, 1.0), runner_.data().tests[b.test].test.sample_rate,
                       Hold::first_order);
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i)
      column[i] = filter.step(applied_[i]) - applied_[i];
  }
  return column;
}

std::vector<double> ModeProbes::tipMode(std::size_t axis, double frequency, double damping_ratio) const {
  std::vector<double> column(runner_.size(), 0.0);
  const std::vector<Block>& blocks = runner_.blocks();
  for (std::size_t first = 0; first < blocks.size();) {
    std::size_t end = first;
    while (end < blocks.size() && blocks[end].test == blocks[first].test) ++end;
    const TestData& data = runner_.data().tests[blocks[first].test];
    const double rate = data.test.sample_rate;
    ModalFilter tip(oneMode(frequency, damping_ratio, 1.0), rate, Hold::first_order);
    std::vector<double> displacement;
    if (data.test.kind == TestKind::tap && data.record.has(TIP[axis]) &&
        data.test.direction == (axis == 0 ? "x" : "y")) {
      for (const double f : data.record.column("hammer")) displacement.push_back(tip.step(f));
    }
    for (std::size_t b = first; b < end && data.test.kind == TestKind::cut; ++b) {
      if (blocks[b].channel != FORCES[axis]) continue;
      for (std::size_t i = 0; i < blocks[b].size; ++i)
        displacement.push_back(tip.step(applied_[blocks[b].offset + i] * blocks[b].noise));
    }
    for (std::size_t b = first; b < end && !displacement.empty(); ++b) {
      if (blocks[b].channel != TIP[axis]) continue;
      for (std::size_t i = 0; i < blocks[b].size; ++i)
        column[blocks[b].offset + i] = displacement[i] / blocks[b].noise;
    }
    if (data.test.kind == TestKind::cut && !displacement.empty() && data.record.has("spindle_angle")) {
      const std::vector<Stiffness>& table = stiffness_.at(blocks[first].test);
      const double period = units::TWO_PI / model_.tool->teeth / data.test.spindle_speed * rate;  // [samples]
      const std::vector<double>& angle = data.record.column("spindle_angle");
      for (std::size_t b = first; b < end; ++b) {
        const auto a = static_cast<std::size_t>(std::find(FORCES.begin(), FORCES.end(), blocks[b].channel) -
                                                FORCES.begin());
        if (a >= 3) continue;
        ModalFilter sensor(model_.force_sensor.axis[a], rate, Hold::first_order);
        for (std::size_t i = 0; i < blocks[b].size; ++i) {
          const double before = static_cast<double>(i) - period;
          double past = 0.0;
          if (before > 0.0) {
            const auto n = static_cast<std::size_t>(before);
            const double share = before - static_cast<double>(n);
            past = (1.0 - share) * displacement[n] + share * displacement[n + 1];
          }
          const auto p = static_cast<std::size_t>(angle[i] / units::TWO_PI * POINTS) % POINTS;
          const double force = i < data.first_cut ? 0.0 : table[p][a][axis] * (displacement[i] - past);
          column[blocks[b].offset + i] = sensor.step(force) / blocks[b].noise;
        }
      }
    }
    first = end;
  }
  return column;
}

std::vector<double> ModeProbes::grid(double low, double high, double ratio) {
  std::vector<double> frequencies;
  for (double f = low; f < high; f *= ratio) frequencies.push_back(f);
  return frequencies;
}

}  // namespace smartmill::discrepancy
