// Copies of a Simulation's lists and state in the shape that kernels want, for benches that call kernels themselves.
#pragma once

#include <memory>
#include <vector>

#include "core/simulation.h"

namespace platen::bench {

template <class T>
AlignedArray<T> copy_of(const AlignedArray<T>& from) {
  AlignedArray<T> to;
  to.resize(from.size());
  std::copy(from.begin(), from.end(), to.begin());
  return to;
}

struct StateCopy {
  explicit StateCopy(const Particles& p);
  AlignedArray<double> x, y, z, vx, vy, vz, ux, uy, uz, inverse_mass, mass, radius, inverse_radius, rows;
  AlignedArray<std::int8_t> crossed;
};

struct PlateCopy {
  int plate = 0;
  AlignedArray<std::int32_t> particle;
  AlignedArray<double> xi_x, xi_y, xi_z, stiffness_last, records, overlap;
  std::int32_t used = 0, padded = 0;
  PlateBatch view(const StateCopy& state);
};

struct BatchCopy {
  explicit BatchCopy(const Batch& b);
  AlignedArray<std::int32_t> row_j;
  AlignedArray<PairTargets> targets;
  AlignedArray<OwnersOfEight> owners;
  AlignedArray<double> sp, tx, ty, tz, k_t_last, sum;
  std::vector<float> speed2;
  std::int32_t first = 0, count = 0, used = 0, padded = 0;
  std::vector<std::int32_t> halo;
  std::vector<Incoming> incoming;
  std::vector<PlateCopy> plates;  // those with spheres near them
  PairBatch pairs(const StateCopy& state);
  MotionBatch motion(StateCopy& state, bool clears = false);  // `clears`: the sums of own particles
  // What a pass reads and writes [bytes]: lists and history, rows of the spheres that occur, sums.
  std::int64_t list_bytes() const;
  std::int64_t row_bytes() const;
  std::int64_t sum_bytes() const;
};

std::vector<BatchCopy> copies_of(const Simulation& sim);

// Constants of the motion of equal or unequal spheres as core sets them up; kick = drift = dt.
MotionConstants motion_constants(const Simulation& sim, const PairLaw& law, double gravity);

}  // namespace platen::bench
