// A batch: a contiguous range of particles along the Morton curve, and the contacts that it owns.
//
//   particles   ... | first ............ first+count | ...      whole vectors
//   outer list  pairs of own particles within R_i + R_j + margins, by owner; lives from rebuild to rebuild
//   inner list  those of them within smaller margins, in the same order, with the history; all that the contact kernel sees
//   sums        [ own particles | halo slots | zero ]    halo slot: one per foreign partner, written by this batch only,
//                                                         read by the partner's batch through `incoming`
//
// A pair across two batches belongs to one of them [core/neighbours.h, Ownership].
#pragma once

#include <cstdint>
#include <vector>

#include "core/aligned.h"
#include "core/owned_counts.h"
#include "core/snapshot.h"
#include "kernels/owner_runs.h"
#include "kernels/views.h"

namespace platen {

struct PlateList {
  AlignedArray<std::int32_t> particle;
  AlignedArray<double> xi_x, xi_y, xi_z, stiffness_last;  // history
  AlignedArray<double> records, overlap;                  // of the last pass
  std::int32_t used = 0, padded = 0;
};

// Records of another batch that belong to particles of ours: a stretch of its halo slots.
struct Incoming {
  std::int32_t batch;
  std::int32_t slot;   // first of them, in that batch's halo
  std::int32_t count;
};

struct Batch {
  std::int32_t first = 0, count = 0;
  int colour = 0;                     // 0 for all unless it decides who owns a pair
  double centre[3] = {0, 0, 0};       // of its spheres when the lists were made [m]

  OwnedCounts outer_owned;  // outer pairs of each sphere, and their partners
  PooledVector<std::int32_t> outer_j;
  AlignedArray<std::uint64_t> listed;  // a bit for each outer pair: set where it is in the inner list

  std::int32_t used = 0, padded = 0;  // pairs of the inner list
  AlignedArray<std::int32_t> row_j;  // kernels/views.h
  AlignedArray<PairTargets> to;
  AlignedArray<OwnersOfEight> owners_of_eight;  // one for each eight pairs
  std::int32_t i(std::size_t k) const { return first + owner_of(to[k]); }
  std::int32_t j(std::size_t k) const { return row_j[k] / row_size; }
  AlignedArray<double> sp, tx, ty, tz, k_t_last;
  std::int32_t ahead = 0;               // PairBatch::ahead, if it is asked for

  AlignedArray<double> sum;           // records
  std::vector<std::int32_t> halo;     // particle of each halo slot, ascending
  std::vector<Incoming> incoming;
  std::vector<int> partners;          // batches whose particles our outer pairs touch
  std::vector<int> owners;            // batches whose outer pairs touch our particles

  PlateList plates[plate_count];

  // Since the last collection.
  PairTotals pair_totals;             // contacts: of the last pass alone, by which the next one chooses (PairBatch::dense)
  std::int64_t plate_energy[term_count] = {};
  std::int64_t plate_work = 0;
  std::int64_t rolling = 0;
  // Largest speed of its spheres in the last motion, relative to the common velocity [m/s]; of the batches that list it as a
  // partner too. Places that fill up the last vector count as spheres at rest, which costs time in a bed that falls.
  double fastest = 0.0;
  bool out_of_range = false;
};

}  // namespace platen
