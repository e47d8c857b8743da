// Taking the state of a Simulation out, and putting one in.
#include "core/simulation_state.h"

#include <algorithm>
#include <stdexcept>
#include <tuple>

#include "core/float_mode.h"
#include "core/simulation_detail.h"

namespace platen {

SimulationState Simulation::whole_state() {
  const FloatMode mode;
  // Forces that are due are left due: to find them once more than without a checkpoint could change a last bit, where a spring
  // is cut to its limit twice.
  if (batches_.empty()) ensure_forces();
  ChunkedArray<double> sums;
  keep_sums(sums);
  SimulationState s;
  const Particles& p = particles_;
  s.id = p.id_of_rank.all();
  for (const std::int32_t place : p.places()) {
    const auto k = static_cast<std::size_t>(place);
    s.radius.push_back(p.radius_of(place));
    s.position.insert(s.position.end(), {p.x[k], p.y[k], p.z[k]});
    s.velocity.insert(s.velocity.end(), {p.vx[k], p.vy[k], p.vz[k]});
    s.turning.insert(s.turning.end(), {p.ux[k], p.uy[k], p.uz[k]});
    s.image.insert(s.image.end(), {p.boxes(k, 0), p.boxes(k, 1)});
  }
  s.sums = sums.in_a_row();
  s.pairs = pair_history(batches_, p).pairs.in_a_row();
  std::sort(s.pairs.begin(), s.pairs.end(), [](const PairHistory& a, const PairHistory& b) { return std::tie(a.low, a.high) < std::tie(b.low, b.high); });
  s.plates = plate_history(batches_, p);
  s.planes = planes_;
  s.forces_valid = forces_valid_, s.forces_dt = law_.dt;
  s.sides_open = !periodic();
  s.step = step_, s.step_base = step_base_;
  s.dt = dt_, s.last_drift = last_drift_, s.time_base = time_base_;
  s.contacts = contacts_;
  std::copy(std::begin(dissipated_), std::end(dissipated_), std::begin(s.dissipated));
  s.rolling = rolling_, s.plate_work = plate_work_;
  s.inserted = inserted_, s.removed = removed_;
  s.rebuilds = counters_.rebuilds, s.prunes = counters_.prunes, s.redone_steps = counters_.redone_steps;
  return s;
}

void Simulation::take_up(const SimulationState& s) {
  const FloatMode mode;
  Particles& p = particles_;
  const auto n = static_cast<std::size_t>(p.count);
  if (s.id != p.id_of_rank.all() || s.radius.size() != n || s.position.size() != 3 * n || s.velocity.size() != 3 * n || s.turning.size() != 3 * n ||
      s.image.size() != 2 * n || s.sums.size() != record_size * n)
    throw std::invalid_argument("the state is that of other spheres");
  const auto is_rank = [&](std::int32_t r) { return r >= 0 && r < p.count; };
  for (const PairHistory& h : s.pairs)
    if (!is_rank(h.low) || !is_rank(h.high)) throw std::invalid_argument("the state has contacts of spheres that are not there");
  for (const PlateHistory& h : s.plates)
    if (!is_rank(h.rank) || h.plate < 0 || h.plate >= plate_count) throw std::invalid_argument("the state has contacts of spheres that are not there");
  const std::vector<std::int32_t> places = p.places();
  for (std::size_t rank = 0; rank < n; ++rank) {
    const auto k = static_cast<std::size_t>(places[rank]);
    p.x[k] = s.position[3 * rank], p.y[k] = s.position[3 * rank + 1], p.z[k] = s.position[3 * rank + 2];
    p.vx[k] = s.velocity[3 * rank], p.vy[k] = s.velocity[3 * rank + 1], p.vz[k] = s.velocity[3 * rank + 2];
    p.ux[k] = s.turning[3 * rank], p.uy[k] = s.turning[3 * rank + 1], p.uz[k] = s.turning[3 * rank + 2];
    p.image[2 * k] = s.image[2 * rank], p.image[2 * k + 1] = s.image[2 * rank + 1];
    p.crossed[2 * k] = p.crossed[2 * k + 1] = 0;
  }
  p.write_rows();
  planes_ = s.planes;
  if (s.sides_open) take_sides_away();
  step_ = s.step, step_base_ = s.step_base;
  dt_ = s.dt, last_drift_ = s.last_drift, time_base_ = s.time_base;
  contacts_ = s.contacts;
  std::copy(std::begin(s.dissipated), std::end(s.dissipated), std::begin(dissipated_));
  rolling_ = s.rolling, plate_work_ = s.plate_work;
  inserted_ = s.inserted, removed_ = s.removed;
  PairHistories pairs;
  pairs.start.assign(n + 1, 0);
  for (const PairHistory& h : s.pairs) ++pairs.start[static_cast<std::size_t>(h.low) + 1];
  for (std::size_t k = 1; k <= n; ++k) pairs.start[k] += pairs.start[k - 1];
  pairs.pairs.assign(s.pairs);
  ChunkedArray<double> sums;
  sums.assign(s.sums);
  rebuild_from(pairs, s.plates, &sums);
  forces_valid_ = s.forces_valid, law_.dt = plate_law_.dt = s.forces_dt;
  counters_.rebuilds = s.rebuilds, counters_.prunes = s.prunes, counters_.redone_steps = s.redone_steps;
}

}  // namespace platen
