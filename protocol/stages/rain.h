// Where spheres start that rain into the box: a loose random gas above the floor.
#pragma once

#include <limits>
#include <vector>

#include "protocol/case_file.h"
#include "protocol/stages/random_source.h"

namespace platen {

// Centres, N x 3 [m], of spheres of the given radii [m] that neither overlap each other (periodic images across x = 0,
// width and y = 0, depth included when `periodic`; else every sphere is wholly inside those faces) nor come nearer to
// z_floor [m] than 0.05 R. Spheres are inserted at random in order, layer by layer from below: a layer is closed when
// it holds `solid_fraction` [-] of solid, or earlier where no place is found. As tall as needed. 0 <= x < width, 0 <=
// y < depth in a periodic box.
//
// With a `z_ceiling` [m] the last layer ends there, unless its spheres find no place below.
//
// Throws std::invalid_argument when a sphere is wider than the box, or for a fraction outside (0, 0.34]: random
// insertion itself comes to rest at 0.38 [Widom1966].
std::vector<double> rain_positions(const std::vector<double>& radii, double width, double depth, bool periodic,
                                   double z_floor, double solid_fraction, RandomSource& random,
                                   double z_ceiling = std::numeric_limits<double>::infinity());

inline constexpr double rain_solid_fraction = 0.25;  // where all spheres fall at once

// Height that a rain with a duration falls from [m]: the one given, else that of the box.
inline double outlet_of(const Case& c) { return c.stages.front().outlet.value_or(c.box.height); }

// What comes down to the outlet in that duration [m]. Spheres are given drop_speed anew every `check_every` steps (of dt [s])
// and fall freely in between.
inline double rain_column(const Case& c, double dt) {
  const StageSpec& fill = c.stages.front();
  return *fill.duration * (fill.drop_speed + 0.5 * c.gravity * static_cast<double>(c.engine.check_every) * dt);
}

}  // namespace platen
