// Rebuild: batches, outer lists, ownership [docs/architecture.md, "Lists"]. Nothing here can change a bit
// of the result: lists only say which pairs are looked at, and sums do not depend on their order.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/batch_cuts.h"
#include "core/batches.h"
#include "core/margins.h"
#include "core/parallel_for.h"
#include "core/particles.h"
#include "kernels/kernel_table.h"

namespace platen {

struct Domain {
  double width = 0.0, depth = 0.0;  // periodic lengths [m]; 0 where not periodic
  double inverse_width = 0.0, inverse_depth = 0.0;

  Domain() = default;
  Domain(double w, double d) : width(w), depth(d), inverse_width(w > 0.0 ? 1.0 / w : 0.0), inverse_depth(d > 0.0 ? 1.0 / d : 0.0) {}

  // The image of a difference nearest to 0, as the contact kernel takes it.
  double nearest_x(double d) const { return nearest(d, width, inverse_width); }
  double nearest_y(double d) const { return nearest(d, depth, inverse_depth); }
  static double nearest(double d, double length, double inverse) {
    const double magic = 0x1.8p52;
    return d - length * ((d * inverse + magic) - magic);
  }
};

// Whose a pair across two batches is.
enum class Ownership {
  ahead,     // of the one whose sphere has the other's ahead of it on the curve, taken as a ring
  by_colour  // for fused tasks: of the one of the lower colour, so that within a step no two batches wait for each other [step_graph.cpp]
};

// Cuts the particles into batches and fills their outer lists with every pair closer than
// R_i + R_j + both margins. Particles must be in Morton order, rows up to date.
std::vector<Batch> make_batches(const Particles& particles, const Domain& domain, const Margins& margins, const Cuts& cuts, Ownership ownership,
                                const KernelTable& kernels, const ParallelFor& parallel);

// Batch of a particle.
struct BatchOf {
  std::vector<std::int32_t> starts;  // first particle of each batch, ascending
  int operator()(std::int32_t particle) const;
};

}  // namespace platen
