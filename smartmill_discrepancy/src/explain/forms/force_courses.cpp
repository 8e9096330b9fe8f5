#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "explain/forms/form_family.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

struct CourseOptions {
  std::size_t bins = 400;   ///< of the longest course: a spot of a hundredth of it still has several
  double min_gain = 100.0;  ///< [squares] with less the fit could not reach SearchOptions::min_gain
  double reach = 0.05;      ///< [1] of a probe: the force is proportional to the factors
};

/// Scale of the force that the residual requests, by the place in the course of a cut.
struct LocalScale {
  double samples = 0.0;
  double longest = 0.0;                  // [mm], [s] or [1]
  std::vector<double> product, squares;  // of residual and simulated force, and of the latter, in each bin

  double width() const { return longest / static_cast<double>(product.size()); }
  double place(std::size_t bin) const { return (static_cast<double>(bin) + 0.5) * width(); }
};

// Units of the course that a cut completes in a second.
double rateOf(const std::string& over, const CampaignTest& test, int teeth) {
  if (over == "time") return 1.0;
  const double revolutions = test.spindle_speed / units::TWO_PI;
  return over == "revolutions" ? revolutions
                               : revolutions * teeth * test.engagement->feed_per_tooth / units::MM;
}

LocalScale localScale(const FormContext& context, const std::string& over, std::size_t bins) {
  const TwinRunner& runner = context.runner;
  const int teeth = runner.data().nominal.needTool("explain").teeth;
  struct Piece {
    const ChannelSpan* span;
    double begin, step;  // sample of the engagement, places per sample
  };
  std::vector<Piece> pieces;
  LocalScale scale;
  for (const ChannelSpan& b : runner.spans()) {
    const CampaignTest& test = runner.data().tests[b.test].test;
    // A cut that began before its record is somewhere in its course.
    const bool force = std::find(FORCES.begin(), FORCES.end(), b.channel) != FORCES.end();
    if (test.kind != TestKind::cut || !force || b.slow || !b.in_gap || test.running_before) continue;
    pieces.push_back({&b, test.engage_time.value_or(0.0) * test.sample_rate,
                      rateOf(over, test, teeth) / test.sample_rate});
    scale.longest =
        std::max(scale.longest, (static_cast<double>(b.size) - pieces.back().begin) * pieces.back().step);
  }
  scale.product.assign(bins, 0.0);
  scale.squares.assign(bins, 0.0);
  if (scale.longest <= 0.0) return scale;
  for (const Piece& p : pieces) {
    for (auto i = static_cast<std::size_t>(std::ceil(p.begin)); i < p.span->size; ++i) {
      const std::size_t k = p.span->offset + i;
      const double residual = context.now.residual[k], force = runner.measured()[k] - residual;
      const double place = (static_cast<double>(i) - p.begin) * p.step;
      const std::size_t bin = std::min(static_cast<std::size_t>(place / scale.width()), bins - 1);
      scale.product[bin] += residual * force;
      scale.squares[bin] += force * force;
      ++scale.samples;
    }
  }
  return scale;
}

struct Course {
  std::vector<std::size_t> nodes;  // bins, rising
  double gain = 0.0;               // [squares] against a constant scale
};

// Gain of a piecewise linear scale with these nodes over no change of the force.
double gainOf(const LocalScale& scale, const std::vector<std::size_t>& nodes) {
  const auto n = static_cast<Eigen::Index>(nodes.size());
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(n);
  std::size_t next = 1;
  for (std::size_t bin = 0; bin < scale.product.size(); ++bin) {
    while (next + 1 < nodes.size() && bin > nodes[next]) ++next;
    const double share =
        static_cast<double>(bin - nodes[next - 1]) / static_cast<double>(nodes[next] - nodes[next - 1]);
    const auto k = static_cast<Eigen::Index>(next);
    const double low = 1.0 - share, q = scale.squares[bin], p = scale.product[bin];
    a(k - 1, k - 1) += low * low * q;
    a(k - 1, k) += low * share * q;
    a(k, k - 1) += low * share * q;
    a(k, k) += share * share * q;
    b(k - 1) += low * p;
    b(k) += share * p;
  }
  // Nodes without samples between them have no influence.
  a.diagonal().array() += 1e-9 * a.trace() / static_cast<double>(n) + 1e-300;
  return b.dot(a.ldlt().solve(b));
}

// The nodes that reduce the residual most, one after the other.
std::vector<Course> coursesOf(const LocalScale& scale, std::size_t most) {
  double product = 0.0, squares = 1e-300;
  for (std::size_t k = 0; k < scale.product.size(); ++k) {
    product += scale.product[k];
    squares += scale.squares[k];
  }
  const double constant = product * product / squares;
  std::vector<std::size_t> nodes{0, scale.product.size() - 1};
  std::vector<Course> courses{{nodes, gainOf(scale, nodes) - constant}};
  while (nodes.size() < most) {
    Course best{{}, -1.0};
    for (std::size_t bin = 1; bin + 1 < scale.product.size(); ++bin) {
      if (std::binary_search(nodes.begin(), nodes.end(), bin)) continue;
      std::vector<std::size_t> with = nodes;
      with.insert(std::upper_bound(with.begin(), with.end(), bin), bin);
      const double gain = gainOf(scale, with) - constant;
      if (gain > best.gain) best = {std::move(with), gain};
    }
    nodes = best.nodes;
    courses.push_back(std::move(best));
  }
  return courses;
}

/// Courses of the force over path, time and revolutions, with the number of nodes of the best BIC.
class ForceCourses : public FormFamily {
 public:
  void locate(const FormContext& context, std::vector<Hypothesis>* located) const override {
    std::map<std::string, std::vector<const Hypothesis*>> by_course;  // those with fewer nodes first
    for (const Hypothesis& h : context.forms) {
      if (isForm(h, "force_course", "")) by_course[h.variant].push_back(&h);
    }
    for (const auto& [over, forms] : by_course) {
      const LocalScale scale = localScale(context, over, options_.bins);
      if (scale.longest <= 0.0) continue;
      const std::vector<Course> courses = coursesOf(scale, forms.back()->coordinates.size());
      const auto worth = [&](const Hypothesis* h) {
        const auto nodes = static_cast<double>(h->coordinates.size());
        return courses[h->coordinates.size() - 2].gain - nodes * std::log(scale.samples);
      };
      const Hypothesis* best =
          *std::max_element(forms.begin(), forms.end(),
                            [&](const Hypothesis* a, const Hypothesis* b) { return worth(a) < worth(b); });
      if (worth(best) < options_.min_gain) continue;
      Hypothesis at = *best;
      std::vector<double> places;
      for (const std::size_t bin : courses[at.coordinates.size() - 2].nodes)
        places.push_back(scale.place(bin));
      at.list("at", places).straight({options_.reach});
      located->push_back(at.named(over + formatted(", %zu nodes", places.size())));
    }
  }

 private:
  CourseOptions options_;
};

}  // namespace

std::unique_ptr<FormFamily> makeForceCourses() {
  return std::make_unique<ForceCourses>();
}

}  // namespace smartmill::discrepancy
