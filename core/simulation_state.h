// Everything that the next step depends on, and the sums over all steps before it: what has to be kept to go on elsewhere
// or later with the same bits. Lists, batches and margins are not: they change no bits.
#pragma once

#include <cstdint>
#include <vector>

#include "core/contacts.h"
#include "core/fixed_sum.h"
#include "core/plates.h"

namespace platen {

struct SimulationState {
  // Spheres by rank, i.e. in the order of ids.
  std::vector<std::int64_t> id;
  std::vector<double> radius;           // N [m]
  std::vector<double> position;         // N x 3, wrapped [m]
  std::vector<double> velocity;         // N x 3, at the half step [m/s]
  std::vector<double> turning;          // N x 3, u = R omega at the half step [m/s]
  std::vector<std::int32_t> image;      // N x 2
  std::vector<double> sums;             // N records of forces, kernels/views.h
  std::vector<PairHistory> pairs;       // sorted by (low, high)
  std::vector<PlateHistory> plates;     // sorted by (plate, rank)
  Planes planes;
  bool forces_valid = true;             // false: something other than motion changed since `sums` were found
  double forces_dt = 0.0;               // [s] by which springs were stretched when `sums` were found; 0 where nothing had moved
  bool sides_open = false;              // periodic sides were taken away
  std::int64_t step = 0, step_base = 0; // time = time_base + (step - step_base) dt
  double dt = 0.0, last_drift = 0.0, time_base = 0.0;  // [s]
  std::int64_t contacts = 0;            // touching pairs
  Int128 dissipated[term_count] = {}, rolling = 0, plate_work = 0;  // energy quanta
  double inserted = 0.0, removed = 0.0; // [J]
  std::int64_t rebuilds = 0, prunes = 0, redone_steps = 0;
};

}  // namespace platen
