#include <algorithm>
#include <cmath>

#include "model/effect_declaration.h"
#include "smartmill_core/error.h"

namespace smartmill::effects {
namespace {

const std::vector<std::string>& courseNames() {
  static const std::vector<std::string> NAMES{"path", "time", "revolutions"};
  return NAMES;
}

// Logarithms of the factors at the nodes.
EffectCoordinates factorsAt(std::size_t nodes) {
  EffectCoordinates c;
  const FitRange range = factorRange();
  for (std::size_t k = 0; k < nodes; ++k)
    c.coordinates.push_back({"ln factor at node " + std::to_string(k + 1), 0.0, range.low, range.high,
                             range.step, range.prior_std});
  c.write = [nodes](const double* v, EffectEntry& e) {
    Values& factor = e.lists["factor"];
    for (std::size_t k = 0; k < nodes; ++k) factor.push_back(std::exp(v[k]));
  };
  c.read = [](const EffectEntry& e, double* v) {
    for (const double f : e.lists.at("factor")) *v++ = std::log(f);
  };
  return c;
}

// Several numbers of nodes: a slope needs two, a hard spot five, a wave more. The places follow from the
// residual, so that no form has a probe.
Forms courses(const Scope&) {
  Forms forms;
  for (const std::string& over : courseNames()) {
    for (const std::size_t nodes : {2, 5, 12}) {
      Values at;
      for (std::size_t k = 0; k < nodes; ++k) at.push_back(static_cast<double>(k));
      EffectForm form({factorsAt(nodes)});
      forms.push_back(form.word("over", over).list("at", at).named(over));
    }
  }
  return forms;
}

/// The whole cutting force times a factor that changes in the course of each cut: along the feed, with time
/// or with the revolutions. Linear between the nodes, constant before the first and beyond the last one.
class ForceCourse : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("law", "force_course", EffectStage::cutting_law, 25);
    kind.description =
        "chip and edge coefficients times a factor that is piecewise linear over the path, the time or the "
        "revolutions since this cut began";
    kind.source = "hardness of the work along the feed; heat of the cut";
    kind.parameters = {oneOf("over", courseNames()), series("at", "mm, s or 1", Range::notNegative()),
                       series("factor", "1", Range::positive())};
    kind.needs = {EffectNeed::cuts};
    kind.forms = courses;
    return kind;
  }

  explicit ForceCourse(const EffectEntry& entry)
      : over_(wordOf(entry, "over")), at_(listOf(entry, "at")), factor_(listOf(entry, "factor")) {
    if (at_.size() != factor_.size() || at_.size() < 2)
      throw Error("at and factor: expected the same number of values in both, at least two");
    for (std::size_t k = 1; k < at_.size(); ++k) {
      if (at_[k] <= at_[k - 1]) throw Error("at: expected rising values");
    }
  }

  void update(const Instant& now, TwinState& state) const override {
    const double factor = factorAt(placeOf(now.cut));
    state.law.chip_factor *= factor;
    state.law.edge_factor *= factor;
  }
  bool scalesForce() const override { return true; }

 private:
  // [mm], [s] or [1]
  double placeOf(const CutProgress& cut) const {
    if (over_ == "path") return cut.path / units::MM;
    return over_ == "time" ? cut.time : cut.angle / units::TWO_PI;
  }
  double factorAt(double place) const {
    const auto next = std::upper_bound(at_.begin(), at_.end(), place);
    if (next == at_.begin()) return factor_.front();
    if (next == at_.end()) return factor_.back();
    const auto k = static_cast<std::size_t>(next - at_.begin());
    const double share = (place - at_[k - 1]) / (at_[k] - at_[k - 1]);
    return factor_[k - 1] + share * (factor_[k] - factor_[k - 1]);
  }

  std::string over_;
  Values at_, factor_;  // [mm], [s] or [1]; [1]
};

}  // namespace

EffectKind empiricalForceCourse() {
  return declared<ForceCourse>();
}

}  // namespace smartmill::effects
