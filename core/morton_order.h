// The order in which particles lie in memory.
#pragma once

#include <cstdint>
#include <vector>

#include "core/particles.h"

namespace platen {

// Order along a Morton curve: order[new place] = old place. The curve is swept through the bed layer by layer:
//
//        z ^   +---+---+---+---+        The longer horizontal axis, here x, is cut into layers as thick as spheres are apart;
//          |   | 8 | 7 | 6 | 5 |        within a layer the order is Morton's. Where a layer would have many more than `layer`
//          |   +---+---+---+---+        spheres, the bed is cut into bars along the axis, here two, one after the other, there
//          |   | 1 | 2 | 3 | 4 |        and back.
//          |   +---+---+---+---+
//          +--------------------> x
//
// Most partners of a sphere then lie within two layers, which the second cache holds: all but those across the side of a bar
// or a periodic side. A curve that folds in all three directions leaves more of them further behind [docs/decisions.md].
// layer: 0 = chosen: 500, or 1,000 in beds with layers of more than 3,000, so that a batch is a thin slice of a bar and a group of
// batches in the cache gets through several steps [core/task_order.h].
std::vector<std::int32_t> morton_order(const Particles& particles, int layer = 0, const ParallelFor& parallel = in_turn);

}  // namespace platen
