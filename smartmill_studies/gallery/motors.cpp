// Cheng and Venuvinod: cutting forces from motor currents.

#include <cmath>
#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "loadmeter/turning_scene.h"
#include "smartmill_core/formatted.h"

namespace smartmill::studies {
namespace {

using loadmeter::TurningResult;

/// Table 1.
Drawn calibrationAndPrediction(const std::string&, unsigned seed) {
  const TurningResult r = loadmeter::studyTurning(seed, {}, 12);
  const std::string same = "the simulated centre has the paper's laws and the variances of its table 2";
  Drawn drawn;
  drawn.rows = {
      compareNumber("Fx over Ix, table 1 [N/A]", -198.45, r.x.slope.value, r.x.slope.std_dev, 0.05, same),
      compareNumber("Fx at no current, table 1 [N]", 258.0, r.x.level.value, r.x.level.std_dev, 0.05, same),
      compareNumber("Fz over Iz, table 1 [N/A]", 215.9, r.z.slope.value, r.z.slope.std_dev, 0.05, same),
      {"R2 of the calibration of Fz, table 1", "0.9427", formatted("%.4f", r.fit_z),
       r.fit_z >= 0.9427 ? Verdict::better : Verdict::differs, same}};
  const auto row = [&](const char* what, double seed_rmse, double ours) {
    drawn.rows.push_back({what, formatted("%.0f", seed_rmse), formatted("%.1f", ours),
                          ours <= seed_rmse ? Verdict::better : Verdict::differs,
                          "two thirds of 300 prediction tests that took no part in a choice"});
  };
  row("rms error of Fx by regression, table 1 [N]", 29.0, r.regression.rmse[0]);
  row("rms error of Fy by regression, table 1 [N]", 36.0, r.regression.rmse[1]);
  row("rms error of Fz by regression, table 1 [N]", 27.0, r.regression.rmse[2]);
  row("rms error of Fy by ANFIS, table 1 [N]", 34.0, r.anfis.rmse[1]);
  row("rms error of Fz by ANFIS, table 1 [N]", 21.0, r.anfis.rmse[2]);
  return drawn;
}

/// Table 2.
Drawn variances(const std::string&, unsigned seed) {
  const loadmeter::TurningVariances put_in;
  const TurningResult r = loadmeter::studyTurning(seed, put_in, 400);
  Drawn drawn;
  const auto row = [&](const char* name, double seed_variance, const loadmeter::VarianceSplit& split) {
    drawn.rows.push_back(compareNumber(
        formatted("variance of the current's way of measuring %s, table 2 [N2]", name), seed_variance,
        split.sensor_variance, 0.0, 0.25,
        "400 replications; with the paper's twelve a variance is only known to a factor of two"));
  };
  row("Fy", 383.0, r.fy);
  row("Fz", 260.0, r.fz);
  return drawn;
}

}  // namespace

std::vector<Figure> motorFigures() {
  return {{"cheng_table_1", "Cheng and Venuvinod table 1 and figure 6: forces from motor currents",
           calibrationAndPrediction},
          {"cheng_table_2", "Cheng and Venuvinod table 2: variance of twelve replications", variances}};
}

}  // namespace smartmill::studies
