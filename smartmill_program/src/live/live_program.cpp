#include "smartmill_program/live/live_program.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_program/program_analysis.h"

namespace smartmill::program {
namespace {

constexpr double LEVEL = 1.0 - 1e-9;  // [1] horizontal share of a feed without ramp, despite rounding

bool isSteadyCut(const Step& step) {
  const Move& move = *step.move;
  return !move.rapid && !move.left_hand && step.feed_share >= LEVEL && !step.contact.empty() &&
         (!move.path.isArc() || move.path.plane() == nc::Plane::xy);
}

/// Whether the engagement changes over the height.
bool isBanded(const Contact& contact) {
  return contact.arcs.size() != 1 || contact.arcs.front().bottom != 0.0;
}

/// Encloses a contact, without feed.
Engagement enclosing(const Contact& contact) {
  return {contact.entry(), contact.exit(), contact.axialDepth(), 0.0};
}

/// The same with its bands.
Engagement bandedEngagement(const Contact& contact) {
  Engagement engagement = enclosing(contact);
  for (const EngagedArc& arc : contact.arcs)
    engagement.bands.push_back({arc.entry, arc.exit, arc.bottom, arc.top});
  return engagement;
}

/// [m] Integrals over the height that the torque of chip and edges is in proportion to.
double chipOf(const Contact& contact) {
  double sum = 0.0;
  for (const EngagedArc& arc : contact.arcs) sum += arc.depth() * (std::cos(arc.entry) - std::cos(arc.exit));
  return sum;
}
double edgeOf(const Contact& contact) {
  double sum = 0.0;
  for (const EngagedArc& arc : contact.arcs) sum += arc.depth() * (arc.exit - arc.entry);
  return sum;
}

/// Whether a move continues another along the same circle: programs divide circles.
bool continuesCircle(const Move& before, const Move& move) {
  constexpr double ROUNDING = 2e-6;  // [m] of centres by I and J or R with three decimals
  if (!before.path.isArc() || !move.path.isArc() || before.tool != move.tool || before.feed != move.feed ||
      before.spindle_speed != move.spindle_speed || before.path.sweep() * move.path.sweep() < 0.0)
    return false;
  return std::abs(before.path.radius() - move.path.radius()) <= ROUNDING &&
         std::hypot(before.path.centre()[0] - move.path.centre()[0],
                    before.path.centre()[1] - move.path.centre()[1]) <= ROUNDING;
}

struct Bounds {
  double low, high;
  void add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double rangeWith(double value) const { return std::max(high, value) - std::min(low, value); }
};

/// Joins steps and dwells while their load is constant.
class StretchFinder {
 public:
  StretchFinder(LiveProgram& program, ToolModels& tools, const StretchParameters& parameters)
      : program_(program), tools_(tools), parameters_(parameters) {}

  void add(const Step& step) {
    const auto move = static_cast<std::size_t>(step.move - moves().data());
    if (move != move_ || !any_step_) {
      dwellBefore(move);
      at_ = program_.path.begin(move);
      move_ = move;
      any_step_ = true;
    }
    const double begin = at_, end = at_ + step.length;
    at_ = end;
    const bool contact = !step.air();
    if (contact) {
      addContact(begin, end);
      geometryOf(step.move->tool);
    }
    const bool cut = contact && isSteadyCut(step), air = !contact && step.move->spindle_speed > 0.0;
    if (run_ && !(cut && continuesCut(step)) && !(air && continuesAir(*step.move))) close(contact);
    in_contact_ = contact;
    if (!cut && !air) return;
    if (!run_) start(move, cut, begin);
    run_->last_move = move;
    run_->stretch.end = end;
    run_->stretch.time += step.time;
    run_->last_feed = step.move->rapid ? 0.0 : step.move->feed;
    if (cut) addToCut(step);
  }

  /// [m] on the path, at the end of the last step
  double place() const { return at_; }

  void finish() {
    dwellBefore(moves().size());
    if (run_) close(false);
  }

 private:
  struct Run {
    SteadyStretch stretch;
    std::size_t last_move = 0;
    double last_feed = 0.0;    // [m/s] 0: rapid
    double step_length = 0.0;  // [m]
    std::optional<Bounds> entry, exit, depth, chip, edge;
    std::vector<Engagement> banded;  // of each step of a cut with bands; empty: without
  };
  const std::vector<Move>& moves() const { return program_.path.moves(); }

  const ToolGeometry& geometryOf(int tool) {
    const auto [known, is_new] = program_.tools.try_emplace(tool);
    if (is_new) known->second = *tools_.of(tool).tool;
    return known->second;
  }

  /// The dwells after the moves since the last step. A tool at rest is in air if it was before.
  void dwellBefore(std::size_t move) {
    for (std::size_t m = move_; m < move; ++m) {
      const Move& resting = moves()[m];
      if (run_ && (run_->stretch.cut ? resting.dwell > 0.0 : !continuesAir(resting))) close(false);
      if (resting.dwell == 0.0 || resting.spindle_speed == 0.0 || in_contact_) continue;
      const double place = program_.path.begin(m + 1);
      if (!run_) start(m, false, place);
      run_->stretch.end = place;
      run_->stretch.time += resting.dwell;
    }
  }

  void addContact(double begin, double end) {
    constexpr double ROUNDING = 1e-9;  // [m]
    if (!program_.contact.empty() && program_.contact.back().to >= begin - ROUNDING) {
      program_.contact.back().to = end;
    } else {
      program_.contact.push_back({begin, end});
    }
  }

  bool continuesCut(const Step& step) const {
    if (!run_->stretch.cut) return false;
    if (run_->last_move != move_ &&
        (run_->last_move + 1 != move_ || !continuesCircle(moves()[run_->last_move], moves()[move_])))
      return false;
    const Contact& contact = step.contact;
    const double depth_tolerance = parameters_.depth_tolerance;
    const bool banded = isBanded(contact);
    if (banded == run_->banded.empty()) return false;
    return run_->entry->rangeWith(contact.entry()) <= parameters_.angle_tolerance &&
           run_->exit->rangeWith(contact.exit()) <= parameters_.angle_tolerance &&
           run_->depth->rangeWith(contact.axialDepth()) <= depth_tolerance * contact.axialDepth() &&
           (!banded || (run_->chip->rangeWith(chipOf(contact)) <= depth_tolerance * chipOf(contact) &&
                        run_->edge->rangeWith(edgeOf(contact)) <= depth_tolerance * edgeOf(contact)));
  }
  bool continuesAir(const Move& move) const {
    return !run_->stretch.cut && move.tool == run_->stretch.tool &&
           move.spindle_speed == run_->stretch.spindle_speed;
  }

  void start(std::size_t move, bool cut, double begin) {
    run_ = Run();
    SteadyStretch& stretch = run_->stretch;
    stretch.cut = cut;
    stretch.turns = cut && moves()[move].path.isArc();
    stretch.begin = begin;
    stretch.move = move;
    stretch.tool = moves()[move].tool;
    geometryOf(stretch.tool);
    stretch.spindle_speed = moves()[move].spindle_speed;
    stretch.feed = cut ? moves()[move].feed : 0.0;
    sum_ = {};
  }

  void addToCut(const Step& step) {
    const auto extend = [](std::optional<Bounds>& bounds, double value) {
      if (!bounds) bounds = Bounds{value, value};
      bounds->add(value);
    };
    extend(run_->entry, step.contact.entry());
    extend(run_->exit, step.contact.exit());
    extend(run_->depth, step.contact.axialDepth());
    extend(run_->chip, chipOf(step.contact));
    extend(run_->edge, edgeOf(step.contact));
    if (isBanded(step.contact)) run_->banded.push_back(bandedEngagement(step.contact));
    run_->step_length = step.length;
    sum_.entry += step.length * step.contact.entry();
    sum_.exit += step.length * step.contact.exit();
    sum_.axial_depth += step.length * step.contact.axialDepth();
  }

  /// @param contact whether the tool cuts after the run
  void close(bool contact) {
    const Run run = *std::exchange(run_, std::nullopt);
    SteadyStretch stretch = run.stretch;
    if (stretch.time < parameters_.least_time) return;
    const double revolution = units::TWO_PI / stretch.spindle_speed;
    const double margin = std::max(parameters_.margin_time, revolution);
    if (stretch.cut) {
      const double length = stretch.end - stretch.begin;
      if (run.banded.empty()) {
        stretch.engagement = {sum_.entry / length, sum_.exit / length, sum_.axial_depth / length, 0.0};
      } else {
        stretch.engagement = run.banded[run.banded.size() / 2];
      }
      stretch.engagement.feed_per_tooth = stretch.feed * revolution / geometryOf(stretch.tool).teeth;
      // The engagement is that of the middle of a step.
      const double way = std::max(stretch.feed * margin, run.step_length);
      stretch.steady_from = stretch.begin + way;
      stretch.steady_to = stretch.end - way;
      if (!(stretch.steady_to > stretch.steady_from)) return;
      stretch.from = program_.path.at(stretch.steady_from);
      stretch.to = program_.path.at(stretch.steady_to);
    } else {
      stretch.steady_from = stretch.begin;
      stretch.steady_to = std::max(stretch.begin, stretch.end - (contact ? run.last_feed * margin : 0.0));
    }
    stretch.part = ++parts_[{stretch.cut, moves()[stretch.move].line}];
    program_.stretches.push_back(stretch);
  }

  LiveProgram& program_;
  ToolModels& tools_;
  const StretchParameters& parameters_;
  double at_ = 0.0;       // [m] end of the last step
  std::size_t move_ = 0;  // of the last step
  bool any_step_ = false, in_contact_ = false;
  std::optional<Run> run_;
  Engagement sum_;                             // over the steps of a cut, times length
  std::map<std::pair<bool, int>, int> parts_;  // by kind and line
};

}  // namespace

double LiveProgram::contactBetween(double from, double to) const {
  auto next = std::upper_bound(contact.begin(), contact.end(), from,
                               [](double place, const Interval& interval) { return place < interval.to; });
  double length = 0.0;
  for (; next != contact.end() && next->from < to; ++next)
    length += std::min(to, next->to) - std::max(from, next->from);
  return length;
}

std::optional<Engagement> LiveProgram::enclosingEngagement(double from, double to) const {
  auto next = std::upper_bound(pieces.begin(), pieces.end(), from,
                               [](double place, const PathPiece& piece) { return place < piece.to; });
  std::optional<Engagement> found;
  for (; next != pieces.end() && next->from < to; ++next) {
    if (next->contact.empty()) continue;
    const Engagement here = enclosing(next->contact);
    if (!found) found = here;
    found->entry = std::min(found->entry, here.entry);
    found->exit = std::max(found->exit, here.exit);
    found->axial_depth = std::max(found->axial_depth, here.axial_depth);
  }
  return found;
}

StockBlock stockBlock(const Workpiece& workpiece, const std::array<double, 3>& zero) {
  StockBlock block;
  for (std::size_t a = 0; a < zero.size(); ++a) {
    block.low[a] = workpiece.low[a] - zero[a];
    block.high[a] = workpiece.high[a] - zero[a];
  }
  return block;
}

LiveProgram prepareProgram(const std::string& name, std::vector<Move> moves, ToolModels& tools, Stock& stock,
                           const SimulationOptions& simulation, const StretchParameters& parameters) {
  LiveProgram program{name, ProgramPath(std::move(moves)), {}, {}, {}, {}};
  StretchFinder finder(program, tools, parameters);
  PieceMaker pieces(tools, {parameters.angle_tolerance, parameters.depth_tolerance});
  AnalysisOptions options;
  options.simulation = simulation;
  options.prediction = false;
  ProgramAnalysis analysis(name, tools, stock, options);
  const AnalysisResult result =
      analysis.run(program.path.moves(), [&](const Step& step, const StepPrediction&) {
        finder.add(step);
        pieces.add(step, finder.place() - step.length);
      });
  finder.finish();
  program.pieces = pieces.take();
  if (const std::string collision = collisionText(name, result.blocks); !collision.empty())
    throw Error(collision + ", expected the stock's size and corner in the program's coordinates");
  return program;
}

}  // namespace smartmill::program
