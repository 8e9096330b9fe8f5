#include "discrepancy/bench_score.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"

namespace smartmill::discrepancy {
namespace {

using nlohmann::json;

struct Share {
  int right = 0, all = 0;
  void add(bool is_right) {
    right += is_right;
    ++all;
  }
};

// Wilson's 95 % interval of a share.
std::pair<double, double> wilson(double share, double count) {
  const double z2 = 3.84, middle = (share + z2 / (2.0 * count)) / (1.0 + z2 / count);
  const double half =
      std::sqrt(z2 * (share * (1.0 - share) / count + z2 / (4.0 * count * count))) / (1.0 + z2 / count);
  return {middle - half, middle + half};
}

bool hidesNames(const json& line) {
  return line["kind"] == "single" || line["kind"] == "pair" || line["kind"] == "triple";
}

// Of the held-out tests; older benches reported the floor of all cuts and air cuts without load meter.
double floorOf(const json& line) {
  return line.contains("heldout_floor") ? line["heldout_floor"] : line["floor"];
}

void printShares(const std::vector<json>& lines) {
  std::map<std::string, Share> kinds;
  Share low_gap, halved, halved_above_floor;
  int false_effects = 0, parameters = 0, inside = 0;
  for (const json& line : lines) {
    const std::string kind = line["kind"];
    kinds[kind + (line["vibrating"] ? ", vibrating" : ", rigid")].add(line["right"]);
    kinds[kind].add(line["right"]);
    if (line["kind"] == "outside" && line.contains("heldout_before")) {
      // The repeatable part of a gap exceeds the gap between two runs of the plant.
      const double before = line["heldout_before"], after = line["heldout_after"], floor = floorOf(line);
      halved.add(after <= 0.5 * before);
      if (before > floor)
        halved_above_floor.add(after * after - floor * floor <= 0.25 * (before * before - floor * floor));
    }
    if (!hidesNames(line)) false_effects += line["false_effect"].get<bool>();
    if (!hidesNames(line) || !line["right"]) continue;
    low_gap.add(line["heldout_after"] <= 1.1 * floorOf(line));
    parameters += line["parameters"].get<int>();
    inside += line["inside"].get<int>();
  }
  for (const auto& [kind, share] : kinds)
    std::printf("%s: %d of %d right\n", kind.c_str(), share.right, share.all);
  std::printf("named where no effect of the catalogue was hidden: %d\n", false_effects);
  if (halved.all > 0)
    std::printf(
        "causes outside the catalogue: held-out gap halved in %d of %d; its part above the plant's floor, "
        "where there is one, in %d of %d\n",
        halved.right, halved.all, halved_above_floor.right, halved_above_floor.all);
  if (low_gap.all > 0)
    std::printf("held-out gap at most 1.1 of the plant's floor: %d of %d named cases\n", low_gap.right,
                low_gap.all);
  if (parameters > 0) std::printf("parameters within their 95 %% intervals: %d of %d\n", inside, parameters);
}

std::string tics(const std::vector<std::string>& names) {
  std::string text = "(";
  for (std::size_t k = 0; k < names.size(); ++k)
    text += (k ? ", '" : "'") + names[k] + "' " + std::to_string(k);
  return text + ")";
}

std::size_t place(std::vector<std::string>& names, const std::string& name) {
  const auto at = std::find(names.begin(), names.end(), name);
  if (at != names.end()) return static_cast<std::size_t>(at - names.begin());
  names.push_back(name);
  return names.size() - 1;
}

// Rows: hidden effects; columns: named effects; values: share of the row's cases.
void drawConfusion(const std::vector<json>& lines, const std::string& png) {
  std::vector<std::string> hidden, named;
  std::map<std::pair<std::size_t, std::size_t>, int> count;
  std::map<std::size_t, int> all;
  for (const json& line : lines) {
    if (line["hidden"].size() > 1) continue;
    const std::string truth =
        line["kind"] == "single" ? line["hidden"][0].get<std::string>() : line["kind"].get<std::string>();
    const std::size_t row = place(hidden, truth);
    ++all[row];
    if (line["named"].empty()) {
      const std::string verdict = line["verdict"];
      ++count[{row, place(named, verdict.substr(0, verdict.find(':')))}];
    }
    for (const json& n : line["named"]) ++count[{row, place(named, n["name"])}];
  }
  if (hidden.empty()) return;
  std::string data;
  for (const auto& [key, n] : count)
    data += std::to_string(key.second) + " " + std::to_string(key.first) + " " +
            std::to_string(static_cast<double>(n) / all[key.first]) + " " + std::to_string(n) + "\n";
  Gnuplot picture(png, 1100, 900, 10);
  picture
      << "$m << EOD\n"
      << data << "EOD\nset title 'hidden (rows) and named (columns)'\n"
      << "set palette defined (0 '#f7fbff', 1 '#08519c')\nset cbrange [0:1]\nset xtics rotate by -60 "
      << tics(named) << "\nset ytics " << tics(hidden)
      << "\nset xrange [-0.5:" << std::to_string(named.size()) << "-0.5]\nset yrange ["
      << std::to_string(hidden.size())
      << "-0.5:-0.5]\nplot $m using 1:2:(0.5):(0.5):3 with boxxyerror fillstyle solid 1.0 border lc 'white' "
         "fc "
         "palette notitle, $m using 1:2:(sprintf('%d', $4)) with labels font ',8' tc rgb 'orange' notitle\n";
  picture.draw();
}

// Effects of one range of stated confidence.
struct Bin {
  double stated = 0.0;
  Share named;
};

const std::vector<double> EDGES{0.0, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999, 1.0};

std::vector<Bin> binsOf(const std::vector<json>& lines) {
  std::vector<Bin> bins(EDGES.size() - 1);
  for (const json& line : lines) {
    for (const json& effect : line["named"]) {
      const double confidence = effect["confidence"];
      std::size_t b = 0;
      while (b + 2 < EDGES.size() && confidence >= EDGES[b + 1]) ++b;
      bins[b].stated += confidence;
      bins[b].named.add(effect["right"]);
    }
  }
  return bins;
}

// Stated confidence of each named effect compared with the share that was hidden.
void drawReliability(const std::vector<json>& lines, const std::string& folder) {
  const std::vector<Bin> bins = binsOf(lines);
  std::string data;
  std::ofstream csv(folder + "/reliability.csv");
  csv << "from,to,stated,right,low,high,named_right,named\n";
  std::printf("stated confidence  mean    hidden (95 %% interval)         named\n");
  for (std::size_t b = 0; b < bins.size(); ++b) {
    const Bin& bin = bins[b];
    const double all = bin.named.all;
    if (all == 0.0) continue;
    const double stated = bin.stated / all, right = bin.named.right / all;
    const auto [low, high] = wilson(right, all);
    data += formatted("%.5f %.5f %.5f %.5f\n", stated, right, low, high);
    csv << formatted("%g,%g,%.5f,%.5f,%.5f,%.5f,%d,%d\n", EDGES[b], EDGES[b + 1], stated, right, low, high,
                     bin.named.right, bin.named.all);
    std::printf("%5.3f .. %5.3f     %6.4f  %6.4f (%.2f .. %.2f)           %3d of %d\n", EDGES[b],
                EDGES[b + 1], stated, right, low, high, bin.named.right, bin.named.all);
  }
  if (data.empty()) return;
  Gnuplot picture(folder + "/reliability.png", 700, 650, 10);
  picture << "$r << EOD\n"
          << data
          << "EOD\nset title 'reliability of the stated confidence'\nset xlabel 'stated'\nset ylabel 'share "
             "right'\nset xrange [-0.02:1.02]\nset yrange [0:1.05]\nset key left\nplot x with lines dt 2 lc "
             "'gray' title 'ideal', $r using 1:2:3:4 with yerrorbars pt 7 title 'named effects'\n";
  picture.draw();
}

}  // namespace

void scoreBench(const std::vector<json>& lines, const std::string& folder) {
  printShares(lines);
  drawConfusion(lines, folder + "/confusion.png");
  drawReliability(lines, folder);
}

}  // namespace smartmill::discrepancy
