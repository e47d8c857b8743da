// Parts of Simulation that its source files share.
#pragma once

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "core/chunked.h"
#include "core/simulation.h"

namespace platen {

struct Simulation::Workers {
  explicit Workers(int threads);
  tbb::global_control control;  // without it the process-wide default limits the arena
  tbb::task_arena arena;
};

// What a run of steps goes back to: not to where it began, but behind its first kick. There forces have done what they were found
// for, so that none need be kept; the first step once more is a drift. Tasks of the first step save what is theirs while it is at hand.
// Sides that were crossed since are forgotten [core/particles.h].
struct Simulation::Saved {
  // These nine are empty where the run moves in rows: then the particles' own columns keep that.
  AlignedArray<double> x, y, z;                          // before the first step
  AlignedArray<double> vx, vy, vz, ux, uy, uz;           // after its kick
  struct OfBatch {
    ChunkedArray<double, 2048> history;  // in small pieces: they fit in where lists that came and went have left gaps
    std::int64_t contacts = 0;
    std::int64_t rolling = 0;    // of the kick: dissipated once, however often it is gone on from there [quanta]
    bool out_of_range = false;   // found in the kick
  };
  std::vector<OfBatch> batches;
};

// Calls copy(data, size, offset) for each column of a batch's history and of its plates' last pass, after whole(size)
// with the size of all together.
template <class Whole, class Copy>
void for_each_history(Batch& b, const Whole& whole, const Copy& copy) {
  std::size_t size = 0;
  const auto columns = [&](const auto& each) {
    for (auto* a : {&b.sp, &b.tx, &b.ty, &b.tz, &b.k_t_last}) each(*a);
    for (PlateList& list : b.plates)
      for (auto* a : {&list.xi_x, &list.xi_y, &list.xi_z, &list.stiffness_last, &list.records, &list.overlap}) each(*a);
  };
  columns([&](AlignedArray<double>& a) { size += a.size(); });
  whole(size);
  std::size_t at = 0;
  columns([&](AlignedArray<double>& a) {
    copy(a.data(), a.size(), at);
    at += a.size();
  });
}

// Stored energy of the contacts of a list with a plane, normal and tangential [J].
void add_plate_energy(const PlateList& list, const PlateConstants& c, FixedSum& sum, const Particles& particles);

}  // namespace platen
