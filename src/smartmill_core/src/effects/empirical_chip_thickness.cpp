#include "model/effect_declaration.h"
#include "smartmill_core/error.h"

namespace smartmill::effects {
namespace {

// From the slopes of the effective chip in the segments between nodes, relative to the nominal slope, to
// factors. The last segment continues beyond its node.
void writeProfile(const Values& nodes, const Values& slopes, EffectEntry& e) {
  Values &h = e.lists["h_um"], &factor = e.lists["factor"];
  double effective = 0.0, before = 0.0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    effective += slopes[k] * (nodes[k] - before);
    before = nodes[k];
    h.push_back(nodes[k]);
    factor.push_back(effective / nodes[k]);
  }
}

Values slopesOf(const EffectEntry& e) {
  const Values &h = e.lists.at("h_um"), &factor = e.lists.at("factor");
  Values slopes;
  for (std::size_t k = 0; k < h.size(); ++k)
    slopes.push_back(k == 0 ? factor[0] : (h[k] * factor[k] - h[k - 1] * factor[k - 1]) / (h[k] - h[k - 1]));
  return slopes;
}

// Two straight lines that meet in a kink; below it the nominal slope.
EffectCoordinates kink(double largest) {
  constexpr double SECOND_NODE = 4.0;  // over the first
  const double low = 0.03 * largest, high = 0.9 * largest;
  const FitRange slope = factorRange();
  return {{{"ln h_um of the kink", std::log(0.4 * largest), std::log(low), std::log(high), 1e-3, 0.7},
           {"ln slope behind it", 0.0, slope.low, slope.high, slope.step, slope.prior_std}},
          [](const double* v, EffectEntry& e) {
            const double at = std::exp(v[0]);
            writeProfile({at, SECOND_NODE * at}, {1.0, std::exp(v[1])}, e);
          },
          [](const EffectEntry& e, double* v) {
            v[0] = std::log(e.lists.at("h_um").at(0));
            v[1] = std::log(slopesOf(e).at(1));
          }};
}

// Any rising profile: slopes between fixed nodes.
EffectCoordinates profile(const Values& nodes) {
  const FitRange slope = factorRange();
  EffectCoordinates c;
  for (const double node : nodes)
    c.coordinates.push_back({"ln slope to " + std::to_string(std::lround(node)) + " um", 0.0, slope.low,
                             slope.high, slope.step, slope.prior_std});
  c.write = [nodes](const double* v, EffectEntry& e) {
    Values slopes;
    for (std::size_t k = 0; k < nodes.size(); ++k) slopes.push_back(std::exp(v[k]));
    writeProfile(nodes, slopes, e);
  };
  c.read = [](const EffectEntry& e, double* v) {
    for (const double s : slopesOf(e)) *v++ = std::log(s);
  };
  return c;
}

Forms chipForms(const Scope& scope) {
  const double largest = scope.largest_chip / units::UM;
  EffectForm one({kink(largest)});
  for (const double share : {0.2, 0.35, 0.5, 0.7}) {
    const double at = std::log(share * largest);
    one.probe({at, 0.0}, {{at, -0.05}});
  }
  Values nodes;
  for (const double share : {0.12, 0.25, 0.4, 0.6, 1.0}) nodes.push_back(share * largest);
  return {one.named("kink"), EffectForm({profile(nodes)}).straight({0.02}).named("course")};
}

/// Nonlinear chip law: the chip coefficients times a factor of chip thickness. Chip times factor is piecewise
/// linear between the nodes and rises with the chip.
class ChipThickness : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("chip", "chip_thickness", EffectStage::cutting_law, 10);
    kind.description =
        "chip coefficients times a factor of chip thickness: chip times factor is piecewise linear between "
        "the nodes and rises";
    kind.source = "any profile of the specific force";
    kind.parameters = {series("h_um", "um", Range::positive()), series("factor", "1", Range::positive())};
    kind.needs = {EffectNeed::cuts};
    kind.forms = chipForms;
    return kind;
  }

  explicit ChipThickness(const EffectEntry& entry) {
    const std::vector<double>&chip = listOf(entry, "h_um"), &factor = listOf(entry, "factor");
    if (chip.size() != factor.size() || chip.size() < 2)
      throw Error("h_um and factor: expected the same number of values in both, at least two");
    for (std::size_t k = 0; k < chip.size(); ++k) {
      chip_curve_.chip.push_back(units::UM * chip[k]);
      chip_curve_.effective.push_back(units::UM * chip[k] * factor[k]);
      if (k > 0 && chip_curve_.chip[k] <= chip_curve_.chip[k - 1])
        throw Error("h_um: expected rising values");
      if (k > 0 && chip_curve_.effective[k] <= chip_curve_.effective[k - 1])
        throw Error("h_um times factor: expected rising values");
    }
  }

  void update(const Instant&, TwinState& state) const override { state.law.chip_curve = &chip_curve_; }

 private:
  EffectiveChipCurve chip_curve_;
};

}  // namespace

EffectKind empiricalChipThickness() {
  return declared<ChipThickness>();
}

}  // namespace smartmill::effects
