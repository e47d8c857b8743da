#include "protocol/experiment_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace platen {

// Limits are found anew every so many steps, and where the bed has become clearly denser or more loaded than it was:
// plates stiffen under load, and a fast plate loads a bed in less than limits_every steps.
bool Experiment::limits_are_due(const Measures& m, bool regular) {
  const double stress = std::max(m.stress_top, m.stress_bottom);
  const auto contacts = static_cast<double>(m.contacts), few = 1.5 * sim_->particles();
  const bool due = regular || stress > 1.3 * looked_stress_ + 100.0 || contacts > 1.1 * std::max(looked_contacts_, few);
  if (regular) looked_stress_ = looked_contacts_ = 0.0;
  if (due) looked_stress_ = std::max(looked_stress_, stress), looked_contacts_ = std::max(looked_contacts_, contacts);
  return due;
}

// The automatic step, or the watch over a fixed one.
void Experiment::watch_time_step(Stand& stand, const Measures& m) {
  const StepLimits limits = sim_->step_limits();
  if (!c_.time.step && sim_->time_step() > 0.9 * limits.dt_limit)  // before this look, that is
    warn(sim_->time_step() > limits.dt_limit ? "time step above dt_limit for a while" : "time step above 0.9 dt_limit for a while");
  StepRange& range = current_.time_step;
  range.dt_crit = std::min(range.dt_crit, limits.dt_crit), range.dt_limit = std::min(range.dt_limit, limits.dt_limit);
  if (std::isfinite(limits.dt_limit)) range.largest_share = std::max(range.largest_share, sim_->time_step() / limits.dt_limit);
  const auto log_limits = [&] {  // with the step that holds from now on
    if (std::isfinite(limits.dt_limit))
      folder_.log("limits", {{"step", sim_->step()}, {"dt", sim_->time_step()}, {"dt_crit", limits.dt_crit}, {"dt_pairs", limits.dt_pairs}, {"dt_limit", limits.dt_limit}});
  };
  if (c_.time.step) {
    log_limits();
    const double ratio = sim_->time_step() / limits.dt_limit;
    if (ratio > 1.0 && !c_.time.allow_unstable) {
      std::string ruled_by;
      sim_->step_limits(ruled_by);
      throw RunError(fmt::format("the time step {:.4g} s is above dt_limit = {:.4g} s of the bed at step {} (ruled by {}); use a smaller time.step or \"auto\"",
                                 sim_->time_step(), limits.dt_limit, sim_->step(), ruled_by));
    }
    if (ratio > 0.9) warn(ratio > 1.0 ? "time step above dt_limit" : "time step above 0.9 dt_limit");
    return;
  }
  StepLimits ruling = limits;
  const StepLimits& free = free_;
  // A loose bed says nothing of the dense one that it is about to become.
  if (m.coordination_number < 3.0) ruling.dt_pairs = std::min(ruling.dt_pairs, free.dt_pairs), ruling.dt_limit = std::min(ruling.dt_limit, free.dt_limit);
  const StageKind kind = current_.kind;
  const double wanted = floor_to_grid(std::min(c_.time.safety * ruling.dt_pairs, 0.8 * ruling.dt_limit));
  // Shorter at once, longer only where two looks in a row allow it, and never while spheres fall or are shaken: a bed in the
  // air allows a step that its next impact does not.
  const double now = sim_->time_step(), allowed = std::min(wanted, last_wanted_.value_or(wanted));
  last_wanted_ = wanted;
  const bool loose = kind == StageKind::fill || kind == StageKind::vibrate;
  sim_->set_time_step(loose ? std::min(now, wanted) : allowed);
  log_limits();
  stand.time_step_changed();
}

}  // namespace platen
