#include "protocol/experiment_run.h"

#include <algorithm>
#include <cmath>

namespace platen {

SeriesRow Experiment::row_of(const Measures& m, double speed) const {
  SeriesRow row;
  row.stage = current_.name;
  row.measures = m;
  row.kinetic_to_potential = m.potential_energy != 0.0 ? m.kinetic_energy / m.potential_energy : std::numeric_limits<double>::quiet_NaN();
  if (strain_zero_height_) row.strain = 1.0 - m.height / *strain_zero_height_;
  // I = strain rate * d * sqrt(rho/p) [A34]; no meaning without pressure.
  row.inertial_number = std::numeric_limits<double>::quiet_NaN();
  if (m.stress_top > 0.0 && m.height > 0.0) row.inertial_number = speed / m.height * 2.0 * sim_->mean_radius() * std::sqrt(density_ / m.stress_top);
  if (!c_.output.energy) {
    const double none = std::numeric_limits<double>::quiet_NaN();
    Measures& r = row.measures;
    r.energy_residual = none;
    r.ledger = {none, none, none, none, none, none, none, none, none, none, none, none};
  }
  return row;
}

void Experiment::sample(std::size_t stage, double speed) {
  const Measures m = sim_->measure();
  if (m.deepest_overlap > 0.25) warn("an overlap above a quarter of the diameter: the law is meant for small ones; stiffer spheres or less load help");
  current_.last = row_of(m, speed);
  folder_.append(current_.last, static_cast<int>(stage));
}

std::int64_t Experiment::next_step_of(double interval) const {
  if (!(interval > 0.0)) return std::numeric_limits<std::int64_t>::max();
  const double done = std::floor(sim_->time() / interval * (1.0 + 1e-12) + 1e-9);
  return sim_->step() + std::max<std::int64_t>(1, static_cast<std::int64_t>(std::min(1e15, std::ceil(((done + 1.0) * interval - sim_->time()) / sim_->time_step() - 1e-6))));
}

void Experiment::add_frame() {
  if (framed_step_ == sim_->step()) return;  // the last of a stage is the first of the next
  framed_step_ = sim_->step();
  folder_.add_frame(sim_->snapshot(), sim_->periodic() ? c_.box.width : 0.0, sim_->periodic() ? c_.box.depth : 0.0);
}

void Experiment::show_progress(std::size_t index, const Stand& stand, const std::optional<std::int64_t>& exact, double stage_begin) {
  const double t = wall_clock();
  if (!options_.progress || t - last_progress_ < 0.2) return;
  Progress p;
  p.stage = current_.name;
  p.stage_number = static_cast<int>(index) + 1, p.stages = static_cast<int>(c_.stages.size());
  p.step = sim_->step(), p.time = sim_->time(), p.stage_time = stand.stage_time();
  const StageSpec& spec = c_.stages[index];
  const SeriesRow& row = current_.last;
  if (exact)
    p.fraction = static_cast<double>(sim_->step() - stand.first_step) / static_cast<double>(std::max<std::int64_t>(1, *exact - stand.first_step));
  else if (spec.kind == StageKind::compress && spec.until.stress)
    p.fraction = std::sqrt(std::clamp(row.measures.stress_top / *spec.until.stress, 0.0, 1.0));  // stress grows ever faster
  else if (spec.kind == StageKind::crush && spec.until.strain && !std::isnan(row.strain))
    p.fraction = std::clamp(row.strain / *spec.until.strain, 0.0, 1.0);
  p.wall_seconds = t - wall_begin_;
  if (p.fraction && *p.fraction > 0.02) p.seconds_left = (t - stage_begin) * (1.0 - *p.fraction) / *p.fraction;
  const double steps = static_cast<double>(sim_->step() - progress_step_);
  if (last_progress_ > 0.0) p.particle_steps_per_second = steps * sim_->particles() / (t - last_progress_);
  p.row = row;
  progress_step_ = sim_->step();
  last_progress_ = t;
  options_.progress(p);
}

}  // namespace platen
