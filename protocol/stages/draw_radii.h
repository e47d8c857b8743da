// Radii of a size distribution, drawn one by one.
//
// What is drawn are spheres, so a distribution of volume is turned into one of numbers first: p_0(R) ~ p_3(R) / R^3.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/case_file.h"
#include "protocol/stages/random_source.h"

namespace platen {

// One radius [m]. Truncated distributions are drawn by rejection; throws std::invalid_argument where the range holds so
// little of the distribution that a million draws miss it, and where a list has no positive weight.
double draw_radius(const SizeDistribution& sizes, RandomSource& random);

// `count` radii [m] in order of ids; throws as draw_radius does.
std::vector<double> draw_radii(const SizeDistribution& sizes, std::int64_t count, RandomSource& random);

}  // namespace platen
