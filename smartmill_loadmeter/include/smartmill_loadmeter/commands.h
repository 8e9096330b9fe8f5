#pragma once

#include "smartmill_core/command.h"

namespace smartmill::loadmeter {

/// Cutting coefficients from forces or the load meter.
Command coefficientsCommand();
/// The database of cutting coefficients of a machine.
Command databaseCommand();
/// The fewest test cuts for given standard deviations.
Command planCutsCommand();
/// Inertia and friction of a feed drive from moves in air.
Command axisDriveCommand();
/// Friction and load-meter constants of a machine.
Command calibrateCommand();
/// Force law with the strongest evidence in force records.
Command forceLawCommand();

}  // namespace smartmill::loadmeter
