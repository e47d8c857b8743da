// Inner lists: pruning, the history they carry, halo slots, and the lists of spheres near planes.
#pragma once

#include <cstdint>
#include <vector>

#include "core/batches.h"
#include "core/chunked.h"
#include "core/neighbours.h"
#include "core/particles.h"
#include "core/plates.h"

namespace platen {

// History of a touching pair, signed from the lower to the higher rank (order of ids).
struct PairHistory {
  std::int32_t low, high;  // ranks
  double sp;               // plastic overlap to the power n
  double tx, ty, tz;       // tangential spring on `low` [N]
  double k_t;              // of the last step, exponents other than 1 [N/m]
};

struct PlateHistory {
  std::int32_t rank;
  std::int32_t plate;
  double xi_x, xi_y, xi_z;  // [m]
  double stiffness_last;    // [N/m]
  double overlap;           // of the last pass [m]
  double record[8];         // forces of the last pass, kernels/views.h
};

// All pairs with history, each in the bucket of one of its spheres.
struct PairHistories {
  PooledVector<std::int32_t> start;  // bucket s: pairs start[s] .. start[s + 1]
  ChunkedArray<PairHistory> pairs;
  bool by_place = false;             // a sphere's bucket is its place when they were gathered, as they lie there; else its rank
};

PairHistories pair_history(const std::vector<Batch>& batches, const Particles& particles, const ParallelFor& parallel = in_turn);
// All history with planes, sorted by (plate, rank).
std::vector<PlateHistory> plate_history(const std::vector<Batch>& batches, const Particles& particles);

// Makes the inner lists anew from the outer ones: pairs closer than R_i + R_j + both margins. History is carried from
// the old inner lists, and the sums of particles, which must be merged, stay. Throws std::logic_error if a pair with
// history would be lost (a bug of ours).
void prune(std::vector<Batch>& batches, const Particles& particles, const Domain& domain, const Margins& margins,
           bool with_k_t, const KernelTable& kernels, const ParallelFor& parallel);

// The same for fresh batches without inner lists. bucket[place]: where `history` has a sphere's pairs. Throws std::logic_error if not all of
// `history` is carried.
void fill_inner(std::vector<Batch>& batches, const Particles& particles, const Domain& domain, const Margins& margins,
                bool with_k_t, const PairHistories& history, const std::int32_t* bucket, const KernelTable& kernels, const ParallelFor& parallel);

// Lists of the spheres closer to a present plane than their margins and `gap`, with history from `history` (sorted).
void list_plates(std::vector<Batch>& batches, const Particles& particles, const Planes& planes, std::int64_t step,
                 const Margins& margins, double gap, const std::vector<PlateHistory>& history, const ParallelFor& parallel);

}  // namespace platen
