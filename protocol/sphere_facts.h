// What the spheres of a case amount to, before any of them has moved.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "protocol/case_file.h"

namespace platen {

// The spheres of a case. Of a distribution these are the radii that the run draws with the case's seed.
struct SphereFacts {
  std::int64_t count = 0;
  double radius_min = 0.0, radius_max = 0.0, radius_mean = 0.0;  // [m]
  double density = 0.0;                                          // of all together [kg/m3]
  double mass_min = 0.0, mass_max = 0.0, mass_total = 0.0;       // [kg]
  double solid_volume = 0.0;                                     // [m3]
  bool equal = true;                                             // one radius and one mass
  // Radii below which 10, 50 and 90 % of the solid volume is, of unequal spheres; none of more than ten million.
  std::optional<std::array<double, 3>> volume_radii;             // [m]
};
SphereFacts sphere_facts(const Case& c);

// Of the spheres that `fill` makes [m3].
double solid_volume(const Case& c);

// |f0|/(m g) of the mean sphere; none without gravity.
std::optional<double> bond_number(const Case& c, const SphereFacts& spheres);

}  // namespace platen
