#include "bench/parallel_for_step.h"

#include <tbb/parallel_for.h>

#include <cstring>

#include "bench/harness.h"
#include "core/float_mode.h"

namespace platen::bench {

ParallelForStep::ParallelForStep(const Simulation& sim, const PairLaw& law, double gravity, int threads)
    : state_(sim.state()),
      batches_(copies_of(sim)),
      totals_(batches_.size()),
      kernels_(sim.kernels()),
      law_(sim.law()),
      plate_law_(sim.plate_law()),
      motion_(motion_constants(sim, law, gravity)),
      step_(sim.step()),
      arena_(threads) {
  for (int plate = 0; plate < plate_count; ++plate) planes_.push_back(sim.plane(plate));
  law_.dt = plate_law_.dt = sim.time_step();
}

// As Simulation::merge.
void ParallelForStep::merge(BatchCopy& b) {
  for (const Incoming& in : b.incoming) {
    const BatchCopy& from = batches_[static_cast<std::size_t>(in.batch)];
    const auto slot = static_cast<std::size_t>(in.slot);
    kernels_.merge({b.sum.data(), from.sum.data() + record_size * (static_cast<std::size_t>(from.count) + slot), from.halo.data() + slot, b.first, in.count});
  }
  for (const PlateCopy& list : b.plates)
    for (std::size_t m = 0; m < static_cast<std::size_t>(list.used); ++m) {
      if (!(list.overlap[m] > 0.0)) continue;
      const auto at = record_size * static_cast<std::size_t>(list.particle[m] - b.first);
      const double* record = list.records.data() + record_size * m;
      for (std::size_t k = 0; k < record_size; ++k) b.sum[at + k] += record[k];
    }
}

void ParallelForStep::integrate(int batch) {
  const FloatMode mode;
  BatchCopy& b = batches_[static_cast<std::size_t>(batch)];
  if (!merged_) merge(b);
  MotionTotals totals;
  kernels_.motion(b.motion(state_, true), motion_, totals);
}

void ParallelForStep::contacts(int batch) {
  const FloatMode mode;
  BatchCopy& b = batches_[static_cast<std::size_t>(batch)];
  const auto own = static_cast<std::size_t>(b.count) * record_size;  // zero already
  std::memset(b.sum.data() + own, 0, (b.sum.size() - own) * sizeof(double));
  PairTotals& totals = totals_[static_cast<std::size_t>(batch)];
  totals.contacts = 0;
  kernels_.contacts(b.pairs(state_), law_, totals);
  for (PlateCopy& list : b.plates) {
    Plane plane = plane_shape(list.plate);
    plane.position = planes_[static_cast<std::size_t>(list.plate)].position_at(step_);
    plane.velocity = planes_[static_cast<std::size_t>(list.plate)].velocity_at(step_);
    PlateTotals plate_totals;
    kernels_.plates(list.view(state_), plane, plate_law_, plate_totals);
  }
}

void ParallelForStep::advance(int steps) {
  const int count = static_cast<int>(batches_.size());
  arena_.execute([&] {
    for (int step = 0; step < steps; ++step) {
      tbb::parallel_for(0, count, [&](int k) { integrate(k); });
      merged_ = false;
      ++step_;
      tbb::parallel_for(0, count, [&](int k) { contacts(k); });
    }
  });
}

std::vector<ParallelForStep::BatchTimes> ParallelForStep::times(int steps) {
  const int count = static_cast<int>(batches_.size());
  std::vector<BatchTimes> all(batches_.size());
  for (int step = 0; step < steps; ++step) {
    for (int k = 0; k < count; ++k) all[static_cast<std::size_t>(k)].integrate += seconds_of([&] { integrate(k); }) / steps;
    merged_ = false;
    ++step_;
    for (int k = 0; k < count; ++k) all[static_cast<std::size_t>(k)].contacts += seconds_of([&] { contacts(k); }) / steps;
  }
  return all;
}

double ParallelForStep::bytes() const {
  double all = 0.0;
  for (const BatchCopy& b : batches_) {
    all += static_cast<double>(b.list_bytes() + b.row_bytes() + b.sum_bytes());       // contacts
    all += 8.0 * b.count * (9 + record_size + 1 + 2 * 9 + row_size);                  // owner's columns; integrate
  }
  return all;
}

bool ParallelForStep::same_bits(const Simulation& sim) const {
  const Particles& p = sim.state();
  const auto n = static_cast<std::size_t>(p.count);
  const auto equal = [n](const AlignedArray<double>& a, const AlignedArray<double>& b) {
    return std::memcmp(a.data(), b.data(), n * sizeof(double)) == 0;
  };
  return equal(state_.x, p.x) && equal(state_.y, p.y) && equal(state_.z, p.z) && equal(state_.vx, p.vx) &&
         equal(state_.vy, p.vy) && equal(state_.vz, p.vz) && equal(state_.ux, p.ux) && equal(state_.uy, p.uy) &&
         equal(state_.uz, p.uz);
}

}  // namespace platen::bench
