#pragma once

#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "kalman/burzoni_tables.h"

namespace smartmill::studies {

/// Data shared by Burzoni's figures: one run of the simulated machine per seed, cached for later figures.
const kalman::BurzoniData& burzoniData(unsigned seed);
/// Table 8 + number of it, also cached.
const kalman::BurzoniTable& burzoniTableOf(unsigned seed, std::size_t number);

constexpr double BURZONI_BAND = 2500.0;                   ///< [Hz]
constexpr double BURZONI_RATE = sim::World::SAMPLE_RATE;  ///< [Hz]
/// Colours of seven curves.
constexpr const char* BURZONI_COLOURS[] = {"#2060c0", "#c08040", "#209060", "#c02020",
                                           "#8040a0", "#606060", "#20a0b0"};

/// The eight tables by R of taps and of cuts, as numbers from table 8 on: x 0..3, y 4..7.
constexpr std::size_t HYPOTHESES = 4;

std::vector<Figure> sensorStaticFigures();  ///< tables 2, 3, figures 13, 15, 16
std::vector<Figure> sensorPlantFigures();   ///< figures 21, 24, 25, 27..32, tables 6, 7
std::vector<Figure> sensorTableFigures();   ///< tables 8..15, figures 38, 43..45, 47..56
std::vector<Figure> sensorCutFigures();     ///< figures 39..42, 46, 57

}  // namespace smartmill::studies
