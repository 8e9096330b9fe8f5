#include "smartmill_program/report/tables.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::degFromRad;
using units::MM;

constexpr double MM3 = MM * MM * MM;

/// "0-90:2.5 120-180:1": entry and exit [deg] and depth [mm] of each arc; "0-90:1..2.5" from a height on.
std::string arcsText(const Contact& contact) {
  std::vector<std::string> arcs;
  for (const EngagedArc& arc : contact.arcs) {
    const std::string from = arc.bottom > 0.0 ? formatted("%.4g..", arc.bottom / MM) : "";
    arcs.push_back(formatted("%.2f-%.2f:%s%.4g", degFromRad(arc.entry), degFromRad(arc.exit), from.c_str(),
                             arc.top / MM));
  }
  return joined(arcs, " ");
}

/// The block with the largest value; nullptr: none has one.
const BlockSummary* largest(const std::vector<BlockSummary>& blocks, double BlockSummary::*value,
                            bool least = false) {
  const BlockSummary* found = nullptr;
  for (const BlockSummary& block : blocks) {
    if (std::isnan(block.*value)) continue;
    if (!found || (least ? block.*value < found->*value : block.*value > found->*value)) found = &block;
  }
  return found;
}

}  // namespace

CsvWriter blockTable(const std::vector<BlockSummary>& blocks) {
  CsvWriter csv(
      "block,line,operation,tool,length_mm,time_s,axial_depth_mm,radial_depth_mm,entry_deg,exit_deg,feed_per_"
      "tooth_mm,"
      "volume_mm3,face_volume_mm3,peak_force_n,peak_torque_nm,power_w,stability_margin,wall_error_um,air_"
      "share,rapid_hit,"
      "holder_hit,chip_mm,deflection_um,chatter_probability,name",
      7);
  for (const BlockSummary& b : blocks) {
    csv.row(b.block + 1, b.line, b.operation, b.tool, b.length / MM, b.time, b.axial_depth / MM,
            b.radial_depth / MM, degFromRad(b.entry), degFromRad(b.exit), b.feed_per_tooth / MM,
            b.volume / MM3, b.face_volume / MM3, b.peak_force, b.peak_torque, b.power, b.margin,
            b.wall_error / units::UM, b.airShare(), b.rapid_hit ? 1 : 0, b.holder_hit ? 1 : 0, b.chip / MM,
            b.deflection / units::UM, b.chatter, b.name ? *b.name : "");
  }
  return csv;
}

StepTable::StepTable()
    : csv_(
          "block,line,time_s,x_mm,y_mm,z_mm,length_mm,feed_angle_deg,entry_deg,exit_deg,axial_depth_mm,"
          "radial_depth_mm,"
          "feed_per_tooth_mm,volume_mm3,face_volume_mm3,air,mean_fx_n,mean_fy_n,mean_fz_n,mean_torque_nm,"
          "peak_force_n,"
          "peak_torque_nm,power_w,stability_limit_mm,chip_mm,deflection_um,chatter_probability,wall_error_um,"
          "arcs",
          7) {
}

void StepTable::add(const Step& step, const StepPrediction& prediction) {
  time_ += step.time;
  if (step.move->rapid) return;
  csv_.cell(step.move->block + 1).cell(step.move->line).cell(time_ - 0.5 * step.time);
  for (const double coordinate : step.tip) csv_.cell(coordinate / MM);
  csv_.cell(step.length / MM);
  const double none = BlockSummary::NONE;
  const bool side = !step.contact.empty();
  csv_.cell(step.feed_share > 0.0 ? degFromRad(step.feed_angle) : none);
  csv_.cell(side ? degFromRad(step.contact.entry()) : none)
      .cell(side ? degFromRad(step.contact.exit()) : none);
  csv_.cell(side ? step.contact.axialDepth() / MM : none).cell(side ? step.contact.radialDepth() / MM : none);
  csv_.cell(prediction.feed_per_tooth / MM).cell(step.volume() / MM3).cell(step.face_volume / MM3);
  csv_.cell(step.air() ? 1 : 0);
  const ForcePrediction& force = prediction.force;
  for (const double value : {force.mean.fx, force.mean.fy, force.mean.fz, force.mean.torque, force.peak_force,
                             force.peak_torque, prediction.power})
    csv_.cell(side ? value : none);
  csv_.cell(prediction.limit / MM)
      .cell(prediction.chip / MM)
      .cell(prediction.deflection / units::UM)
      .cell(prediction.chatter)
      .cell(prediction.wall_error / units::UM)
      .cell(arcsText(step.contact));
  csv_.endRow();
}

std::string summaryOf(const std::vector<BlockSummary>& blocks) {
  double time = 0.0, feed_time = 0.0, cut_time = 0.0, volume = 0.0;
  std::size_t unstable = 0;
  for (const BlockSummary& b : blocks) {
    time += b.time;
    feed_time += b.feed_time;
    cut_time += b.cut_time;
    volume += b.volume;
    unstable += b.margin < 1.0;
  }
  std::string text = formatted("%zu blocks, %.1f s; in the cut %.1f s of %.1f s at feed; %.1f mm3 removed\n",
                               blocks.size(), time, cut_time, feed_time, volume / MM3);
  const auto line = [&](const char* what, const BlockSummary* block, double value, const char* unit) {
    if (block)
      text += formatted("%-24s %10.4g %-4s line %d (%s)\n", what, value, unit, block->line,
                        block->label().c_str());
  };
  const BlockSummary* b = largest(blocks, &BlockSummary::axial_depth);
  line("largest axial depth", b, b ? b->axial_depth / MM : 0.0, "mm");
  b = largest(blocks, &BlockSummary::radial_depth);
  line("largest radial depth", b, b ? b->radial_depth / MM : 0.0, "mm");
  b = largest(blocks, &BlockSummary::feed_per_tooth);
  line("largest feed per tooth", b, b ? b->feed_per_tooth / MM : 0.0, "mm");
  b = largest(blocks, &BlockSummary::chip);
  line("largest chip thickness", b, b ? b->chip / MM : 0.0, "mm");
  b = largest(blocks, &BlockSummary::peak_force);
  line("largest force", b, b ? b->peak_force : 0.0, "N");
  b = largest(blocks, &BlockSummary::peak_torque);
  line("largest torque", b, b ? b->peak_torque : 0.0, "N m");
  b = largest(blocks, &BlockSummary::power);
  line("largest power", b, b ? b->power : 0.0, "W");
  b = largest(blocks, &BlockSummary::margin, true);
  line("least stability margin", b, b ? b->margin : 0.0, "");
  if (b) text += formatted("%zu blocks above the stability limit\n", unstable);
  b = largest(blocks, &BlockSummary::deflection);
  line("largest tip deflection", b, b ? b->deflection / units::UM : 0.0, "um");
  b = largest(blocks, &BlockSummary::chatter);
  line("probability of chatter", b, b ? b->chatter : 0.0, "");
  b = nullptr;
  for (const BlockSummary& block : blocks)
    if (!std::isnan(block.wall_error) && (!b || std::abs(block.wall_error) > std::abs(b->wall_error)))
      b = &block;
  line("largest surface error", b, b ? b->wall_error / units::UM : 0.0, "um");
  return text;
}

}  // namespace smartmill::program
