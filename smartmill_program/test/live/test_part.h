#pragma once

#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_program/live/live_program.h"
#include "smartmill_program/nc/program_reader.h"

namespace smartmill::program {

/// Tool of 10 mm with four teeth; block of 60 x 40 x 10 mm with a corner at X0 Y0 and its top at Z0.
inline LiveProgram prepareText(const std::string& text, const StretchParameters& parameters = {},
                               const std::string& edge = "") {
  const TemporaryFolder folder;
  ToolModels models({folder.write(
      "model.yaml",
      "format: smartmill-model/1\ntool: {teeth: 4, diameter_mm: 10.0, helix_deg: 30.0" + edge + "}\n")});
  Stock stock(StockBlock{{0, 0, -0.01}, {0.06, 0.04, 0}}, 1e-4);
  return prepareProgram("part.nc", interpretProgram(text, "part.nc"), models, stock, SimulationOptions(),
                        parameters);
}

}  // namespace smartmill::program
