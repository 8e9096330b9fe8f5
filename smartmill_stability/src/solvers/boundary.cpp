#include "smartmill_stability/solvers/boundary.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "smartmill_core/error.h"

namespace smartmill::stability {
namespace {

using Corner = std::array<int, 2>;  ///< indices of speed and depth on the finest grid
using Edge = std::array<int, 3>;    ///< first corner, and direction: 0 along speed, 1 along depth

class Tracer {
 public:
  Tracer(const FloquetSolver& solver, const TraceOptions& options) : solver_(solver), o_(options) {
    if (!(o_.speed_low > 0.0) || !(o_.speed_high > o_.speed_low))
      throw Error("boundary: empty range of speeds: expected 0 < low < high");
    if (!(o_.max_depth > 0.0)) throw Error("boundary: largest depth: expected a value above 0");
    if (o_.speeds < 4 || o_.speeds > 2000 || o_.depths < 4 || o_.depths > 2000)
      throw Error("boundary: " + std::to_string(o_.speeds) + " x " + std::to_string(o_.depths) +
                  " cells: expected 4..2000 in each direction");
    if (o_.levels < 0 || o_.levels > 6)
      throw Error("boundary: levels " + std::to_string(o_.levels) + ": expected 0..6");
    fine_ = 1 << o_.levels;
  }

  std::vector<BoundaryCurve> trace() {
    std::set<Corner> cells;
    for (int i = 0; i < o_.speeds; ++i)
      for (int j = 0; j < o_.depths; ++j) cells.insert({i, j});
    for (int level = 0;; ++level) {
      const int size = fine_ >> level;
      const int rows = o_.speeds << level, columns = o_.depths << level;
      std::set<Corner> passed;
      // Follow the boundary into cells that were not evaluated yet: a narrow tip continues where a coarser
      // grid lost it.
      std::vector<Corner> open(cells.begin(), cells.end());
      while (!open.empty()) {
        const Corner c = open.back();
        open.pop_back();
        if (!crosses(c, size) || !passed.insert(c).second) continue;
        for (int di = -1; di <= 1; ++di)
          for (int dj = -1; dj <= 1; ++dj) {
            const Corner next{c[0] + di, c[1] + dj};
            const bool inside = next[0] >= 0 && next[1] >= 0 && next[0] < rows && next[1] < columns;
            if (inside && cells.insert(next).second) open.push_back(next);
          }
      }
      if (level == o_.levels) {
        for (const Corner& c : passed) connect(c);
        break;
      }
      // Neighbours are bisected too: the boundary may leave through a corner or turn back between two
      // samples.
      std::set<Corner> next;
      for (const Corner& c : passed)
        for (int di = -1; di <= 1; ++di)
          for (int dj = -1; dj <= 1; ++dj) {
            const int i = c[0] + di, j = c[1] + dj;
            if (i < 0 || j < 0 || i >= rows || j >= columns) continue;
            for (int k = 0; k < 4; ++k) next.insert({2 * i + k % 2, 2 * j + k / 2});
          }
      cells.swap(next);
    }
    return join();
  }

 private:
  double speedAt(double i) const {
    return o_.speed_low + (o_.speed_high - o_.speed_low) * i / (o_.speeds * fine_);
  }
  double depthAt(double j) const { return o_.max_depth * j / (o_.depths * fine_); }

  FloquetSolver::AtSpeed& line(int i) {
    auto& at = lines_[i];
    if (!at) at = solver_.at(speedAt(i));
    return *at;
  }

  static double logRadius(FloquetSolver::AtSpeed& at, double depth) {
    return std::log(std::max(1e-300, at.multiplier(depth).radius()));
  }

  double value(const Corner& c) {
    const auto [it, fresh] = values_.insert({c, 0.0});
    if (fresh) it->second = logRadius(line(c[0]), depthAt(c[1]));
    return it->second;
  }

  static Corner cornerOf(const Corner& cell, int size, int k) {
    return {(cell[0] + (k == 1 || k == 2)) * size, (cell[1] + (k >= 2)) * size};
  }

  bool crosses(const Corner& cell, int size) {
    const bool first = value(cornerOf(cell, size, 0)) > 0.0;
    for (int k = 1; k < 4; ++k)
      if ((value(cornerOf(cell, size, k)) > 0.0) != first) return true;
    return false;
  }

  /// Marching squares on a cell of the finest grid.
  void connect(const Corner& cell) {
    std::vector<Edge> cut;
    const std::array<Edge, 4> edges{
        {{cell[0], cell[1], 0}, {cell[0] + 1, cell[1], 1}, {cell[0], cell[1] + 1, 0}, {cell[0], cell[1], 1}}};
    for (int k = 0; k < 4; ++k) {
      const bool a = value(cornerOf(cell, 1, k)) > 0.0, b = value(cornerOf(cell, 1, (k + 1) % 4)) > 0.0;
      if (a != b) cut.push_back(edges[static_cast<std::size_t>(k)]);
    }
    if (cut.size() == 4) {
      // Saddle: the sign in the middle decides which corners are connected.
      const auto middle = solver_.at(speedAt(cell[0] + 0.5));
      const bool inside = logRadius(*middle, depthAt(cell[1] + 0.5)) > 0.0;
      // Edges are numbered around the cell from corner 0. If corner 0 is connected with the middle, edges 0,
      // 1 and 2, 3 are pairs; otherwise 3, 0 and 1, 2.
      if (inside != (value(cornerOf(cell, 1, 0)) > 0.0)) std::rotate(cut.begin(), cut.begin() + 3, cut.end());
    }
    for (std::size_t k = 0; k + 1 < cut.size(); k += 2) {
      links_[cut[k]].push_back(cut[k + 1]);
      links_[cut[k + 1]].push_back(cut[k]);
    }
  }

  BoundaryPoint crossing(const Edge& edge) {
    const Corner from{edge[0], edge[1]}, to{edge[0] + (edge[2] == 0), edge[1] + (edge[2] == 1)};
    std::unique_ptr<FloquetSolver::AtSpeed> between;
    const auto at = [&](double share) -> FloquetSolver::AtSpeed& {
      if (edge[2] == 1) return line(edge[0]);
      between = solver_.at(speedAt(edge[0] + share));
      return *between;
    };
    const auto depth = [&](double share) { return depthAt(edge[1] + (edge[2] == 1 ? share : 0.0)); };
    double a = 0.0, b = 1.0, fa = value(from), fb = value(to);
    constexpr int ITERATIONS = 12;
    constexpr double CLOSE = 1e-4;
    for (int i = 0; i < ITERATIONS && b - a > CLOSE; ++i) {
      const double secant = std::clamp((a * fb - b * fa) / (fb - fa), a + 0.1 * (b - a), b - 0.1 * (b - a));
      const double middle = i % 3 == 2 ? 0.5 * (a + b) : secant;
      const double f = logRadius(at(middle), depth(middle));
      ((f > 0.0) == (fa > 0.0) ? a : b) = middle;
      ((f > 0.0) == (fa > 0.0) ? fa : fb) = f;
    }
    const double share = fa > 0.0 ? a : b;  // the unstable end
    FloquetSolver::AtSpeed& here = at(share);
    return {speedAt(edge[0] + (edge[2] == 0 ? share : 0.0)), depth(share),
            here.chatterFrequency(depth(share)), here.multiplier(depth(share)).kind()};
  }

  std::vector<BoundaryCurve> join() {
    std::vector<BoundaryCurve> curves;
    std::set<Edge> used;
    const auto walk = [&](Edge edge) {
      BoundaryCurve curve;
      const Edge start = edge;
      for (;;) {
        used.insert(edge);
        curve.points.push_back(crossing(edge));
        const std::vector<Edge>& next = links_[edge];
        const auto free =
            std::find_if(next.begin(), next.end(), [&](const Edge& e) { return used.count(e) == 0; });
        if (free == next.end()) {
          curve.closed = curve.points.size() > 2 && std::find(next.begin(), next.end(), start) != next.end();
          break;
        }
        edge = *free;
      }
      curves.push_back(std::move(curve));
    };
    // Open curves first, from their ends; the remaining ones are closed.
    std::vector<Edge> ends, all;
    for (const auto& [edge, next] : links_) {
      all.push_back(edge);
      if (next.size() == 1) ends.push_back(edge);
    }
    for (const auto* list : {&ends, &all})
      for (const Edge& edge : *list)
        if (used.count(edge) == 0) walk(edge);
    return curves;
  }

  const FloquetSolver& solver_;
  TraceOptions o_;
  int fine_ = 1;
  std::map<int, std::unique_ptr<FloquetSolver::AtSpeed>> lines_;
  std::map<Corner, double> values_;
  std::map<Edge, std::vector<Edge>> links_;
};

}  // namespace

std::vector<BoundaryCurve> traceBoundary(const FloquetSolver& solver, const TraceOptions& options) {
  return Tracer(solver, options).trace();
}

}  // namespace smartmill::stability
