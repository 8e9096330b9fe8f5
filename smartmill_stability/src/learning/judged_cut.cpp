#include "smartmill_stability/learning/judged_cut.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "smartmill_core/io/csv.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

/// Columns of the file by name, and the cells of one line.
class CutReader {
 public:
  explicit CutReader(const std::string& file) : csv_(file) {
    std::vector<std::string_view> cells;
    if (!csv_.nextFilled(&cells)) csv_.fail("expected the header rpm,depth_mm,verdict");
    header_.assign(cells.begin(), cells.end());
    for (const char* name : {"rpm", "depth_mm", "verdict"})
      if (!has(name)) csv_.fail(std::string("column ") + name + " is missing: expected rpm,depth_mm,verdict");
    for (const auto& [value, std_dev] :
         {std::pair{"chatter_hz", "chatter_std_hz"}, std::pair{"kt_n_per_mm2", "kt_std_n_per_mm2"}})
      if (has(std_dev) && !has(value))
        csv_.fail(std::string("column ") + std_dev + ": expected the column " + value);
  }

  bool next(JudgedCut* cut) {
    if (!csv_.nextFilled(&cells_)) return false;
    if (cells_.size() != header_.size()) csv_.fail("expected " + std::to_string(header_.size()) + " cells");
    *cut = {};
    cut->speed = units::radPerSecFromRpm(positive("rpm"));
    cut->depth = positive("depth_mm") * units::MM;
    const std::string_view verdict = cell("verdict");
    cut->chatter = verdict == "chatter";
    if (!cut->chatter && verdict != "stable")
      csv_.fail("verdict '" + std::string(verdict) + "': expected stable or chatter");
    cut->frequency = measured("chatter_hz", "chatter_std_hz", 1.0);
    if (cut->frequency && !cut->chatter) csv_.fail("chatter_hz: expected an empty cell in a stable cut");
    cut->kt = measured("kt_n_per_mm2", "kt_std_n_per_mm2", units::N_PER_MM2);
    if (cut->kt && cut->kt->std_dev == 0.0)
      csv_.fail("kt_n_per_mm2: expected its standard deviation in kt_std_n_per_mm2");
    return true;
  }

  [[noreturn]] void fail(const std::string& what) const { csv_.fail(what); }

 private:
  bool has(const std::string& name) const {
    return std::find(header_.begin(), header_.end(), name) != header_.end();
  }
  std::string_view cell(const std::string& name) const {
    const auto found = std::find(header_.begin(), header_.end(), name);
    return found == header_.end() ? std::string_view{}
                                  : cells_[static_cast<std::size_t>(found - header_.begin())];
  }
  double positive(const std::string& name) const {
    const double value = csv_.number(cell(name), name);
    if (!(value > 0.0)) csv_.fail(name + ": expected a value above 0");
    return value;
  }
  std::optional<Measured> measured(const std::string& value, const std::string& std_dev, double unit) const {
    if (cell(value).empty()) {
      if (!cell(std_dev).empty()) csv_.fail(std_dev + ": expected a value in " + value);
      return std::nullopt;
    }
    return Measured{positive(value) * unit, cell(std_dev).empty() ? 0.0 : positive(std_dev) * unit};
  }

  CsvReader csv_;
  std::vector<std::string> header_;
  std::vector<std::string_view> cells_;
};

}  // namespace

std::vector<JudgedCut> readJudgedCuts(const std::string& file) {
  CutReader reader(file);
  std::vector<JudgedCut> cuts;
  for (JudgedCut cut; reader.next(&cut);) cuts.push_back(cut);
  if (cuts.empty()) reader.fail("no cuts: expected at least one");
  return cuts;
}

}  // namespace smartmill::stability
