// Rebuild: Morton order, batches, outer lists, ownership [docs/architecture.md, "Lists"]. Nothing here can change a bit
// of the result: lists only say which pairs are looked at, and sums do not depend on their order.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/batches.h"
#include "core/particles.h"

namespace platen {

// Calls body(k) for k = 0 .. count-1, in any order, on any thread.
using ParallelFor = std::function<void(int count, const std::function<void(int)>& body)>;

struct Domain {
  double width = 0.0, depth = 0.0;  // periodic lengths [m]; 0 where not periodic
  // The image of a difference nearest to 0, as the contact kernel takes it.
  double nearest_x(double d) const;
  double nearest_y(double d) const;
};

// Order along a Morton curve: order[new place] = old place.
std::vector<std::int32_t> morton_order(const Particles& particles);

// Cuts the particles into batches of about `size` and fills their outer lists with every pair closer than
// R_i + R_j + skin. Particles must be in Morton order.
std::vector<Batch> make_batches(const Particles& particles, const Domain& domain, double skin, int size,
                                const ParallelFor& parallel);

// Batch of a particle.
struct BatchOf {
  std::vector<std::int32_t> starts;  // first particle of each batch, ascending
  int operator()(std::int32_t particle) const;
};

}  // namespace platen
