// The order in which particles lie in memory.
#pragma once

#include <cstdint>
#include <vector>

#include "core/particles.h"

namespace platen {

// Order along a Morton curve: order[new place] = old place. The curve is swept through the bed layer by layer:
//
//        z ^   +---+---+---+---+---        A layer is as thick as spheres are apart and across the longer horizontal
//          |   | 1 | 2 | 3 | 4 | ..        axis; inside it the curve is Morton's. Where a layer would have many more than
//          |   +---+---+---+---+---        `layer` spheres, the bed is cut into bars along the axis, one after the other.
//          +---------------------> x       (Drawn: two bars, the upper one not begun yet.)
//
// A sphere then meets its partners within two layers, which the second cache holds, where a curve that folds in all three
// directions comes back to a sphere's neighbours long after they have left it [docs/decisions.md].
std::vector<std::int32_t> morton_order(const Particles& particles, int layer = 500);

}  // namespace platen
