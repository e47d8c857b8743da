// One trial of the stability bench: a bed, a way to choose its step, and a verdict by explicit criteria.
//
//   bounded         every number finite; mechanical energy never above that at the start plus what plates put in, beyond
//                   5 % of the energy that was turned over; the energy ledger open by no more than 20 % of it (energy
//                   that the step makes may be eaten by dashpots at once, which only the ledger tells); no overlap above
//                   R, no sphere outside, no touching pair missed
//   stopped         the engine, or the watch over the step that every run has, ended it with a message
//   silently wrong  none of the two
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/simulation.h"
#include "tests/scenes.h"

namespace platen::bench {

struct Trial {
  std::string group, name;
  SimulationSetup setup;
  double z_top = 0.0;                  // [m]; 0: no top plate
  double plate_speed = 0.0;            // downward [m/s]
  double amplitude = 0.0;              // of the bottom plate at 60 Hz [m]
  bool bottom = true, walls = false;
  std::int64_t steps = 4000;
  std::int64_t settle_steps = 0;       // at the automatic step before the trial begins
  double share_of_limit = 0.0;         // > 0: a fixed step, this share of dt_limit after settling; 0: automatic
  std::int64_t look_every = 0;         // steps; 0: 40 looks, at most 250 steps apart
  double soft_overlap = 0.0;           // exponents other than 1: overlap whose slope gives the first step [m]
};

struct Verdict {
  std::string verdict, why;
  double gain = 0.0;       // largest (mechanical energy - start - work of plates)/turned over
  double residual = 0.0;   // energy residual/turned over at the end
  double deepest = 0.0;    // largest overlap over the smaller radius that was seen
  double dt = 0.0;         // last [s]
  std::int64_t steps = 0;
};

// Limits before contacts exist, from the law's constants, as the program takes them.
inline StepLimits loose_limits(const Simulation& sim, double soft_overlap) {
  const LawConstants& c = sim.law();
  const double slope = c.exponent == 1.0 ? 1.0 : c.exponent * std::pow(soft_overlap, c.exponent - 1.0);
  const double m = sim.smallest_mass(), K1 = c.k1 * slope, beta = std::sqrt(c.damping * 0.5 * m * K1);
  return free_limits(m, c.k2 * slope, c.ratio * K1, beta, beta * c.beta_ratio);
}

// The automatic step of the program: min(0.3 dt_pairs, 0.8 dt_limit).
inline void choose_step(Simulation& sim, double soft_overlap) {
  StepLimits loose = loose_limits(sim, soft_overlap);
  if (sim.time_step() > 0.0) {
    const StepLimits now = sim.step_limits();
    loose.dt_pairs = std::min(loose.dt_pairs, now.dt_pairs), loose.dt_limit = std::min(loose.dt_limit, now.dt_limit);
  }
  sim.set_time_step(floor_to_grid(std::min(0.3 * loose.dt_pairs, 0.8 * loose.dt_limit)));
}

inline double mechanical(const Measures& m) {
  const Ledger& l = m.ledger;
  return m.energy_residual - l.dissipated() + l.plate_model_work + l.plate_work + l.inserted_energy - l.removed_energy;
}

// What the ledger cannot see; empty when all is well.
inline std::string undetected(Simulation& sim, double& deepest) {
  const Snapshot s = sim.snapshot();
  const ParticleFields& p = s.particles;
  for (const auto* field : {&p.position, &p.velocity, &p.angular_velocity})
    for (const double x : *field)
      if (!std::isfinite(x)) return "a number is not finite";
  for (std::size_t k = 0; k < p.size(); ++k) {
    const double z = p.position[3 * k + 2];
    if (sim.plane(plate_bottom).present && z < s.z_bottom - p.radius[k]) return "a sphere fell through the bottom plate";
    if (sim.plane(plate_top).present && z > sim.plane_position(plate_top) + p.radius[k]) return "a sphere is beyond the top plate";
  }
  const auto index = [&](std::int64_t id) { return static_cast<std::size_t>(std::lower_bound(p.id.begin(), p.id.end(), id) - p.id.begin()); };
  for (std::size_t k = 0; k < s.contacts.size(); ++k) {
    const double R = std::min(p.radius[index(s.contacts.pair[2 * k])], p.radius[index(s.contacts.pair[2 * k + 1])]);
    deepest = std::max(deepest, s.contacts.overlap[k] / R);
  }
  if (deepest > 1.0) return "an overlap above R";
  if (p.size() > 600) return "";
  // Every touching pair, by brute force, must be a contact.
  std::size_t touching = 0;
  const double W = sim.periodic() ? sim.law().width : 0.0, D = sim.law().depth;
  for (std::size_t i = 0; i < p.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      double d[3];
      for (std::size_t a = 0; a < 3; ++a) d[a] = p.position[3 * i + a] - p.position[3 * j + a];
      if (W > 0.0) d[0] = std::remainder(d[0], W), d[1] = std::remainder(d[1], D);
      const double reach = p.radius[i] + p.radius[j], gap = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) - reach;
      if (gap < -1e-12 * reach) ++touching;
    }
  if (touching > s.contacts.size()) return fmt::format("{} touching pairs are no contacts", touching - s.contacts.size());
  return "";
}

inline Verdict run_trial(const Trial& t) {
  Verdict v;
  std::unique_ptr<Simulation> sim;
  double turned_over = 0.0;
  try {
    sim = std::make_unique<Simulation>(t.setup);
    choose_step(*sim, t.soft_overlap);
    if (t.bottom) sim->set_plane(plate_bottom, {});
    PlaneMotion top;
    top.origin = t.z_top;
    if (t.z_top > 0.0) sim->set_plane(plate_top, top);
    if (t.walls) {
      PlaneMotion far;
      sim->set_plane(wall_x_low, {}), sim->set_plane(wall_y_low, {});
      far.origin = t.setup.width, sim->set_plane(wall_x_high, far);
      far.origin = t.setup.depth, sim->set_plane(wall_y_high, far);
    }
    choose_step(*sim, t.soft_overlap);
    if (t.settle_steps > 0) sim->advance(t.settle_steps);
    if (t.share_of_limit > 0.0) sim->set_time_step(t.share_of_limit * sim->step_limits().dt_limit);
    if (t.plate_speed != 0.0) sim->set_plane_velocity(plate_top, -t.plate_speed);
    if (t.amplitude > 0.0) {
      PlaneMotion shaken;
      shaken.amplitude = t.amplitude, shaken.frequency = 60.0, shaken.vibration_end = 1e9;
      sim->set_plane(plate_bottom, shaken);
    }
    const Measures start = sim->measure();
    const Ledger& l0 = start.ledger;
    const double mechanical0 = mechanical(start);
    const std::int64_t chunk = t.look_every > 0 ? t.look_every : std::max<std::int64_t>(1, std::min<std::int64_t>(250, t.steps / 40));
    const double fixed = l0.elastic_energy + l0.plate_energy + l0.tangential_energy + start.kinetic_energy + start.weight * sim->mean_radius();
    while (v.steps < t.steps) {
      sim->advance(chunk);
      v.steps += chunk;
      const Measures m = sim->measure();
      const Ledger& l = m.ledger;
      const double work = l.plate_work - l0.plate_work + l.plate_model_work - l0.plate_model_work;
      turned_over = fixed + (l.dissipated() - l0.dissipated()) + std::fabs(work) - l.adhesion_energy;
      const double gain = (mechanical(m) - mechanical0 - work) / turned_over;
      if (!std::isfinite(gain)) v.verdict = "silently wrong", v.why = "energy is not a number";
      v.gain = std::max(v.gain, gain);
      v.residual = (m.energy_residual - start.energy_residual) / turned_over;
      const std::string hidden = undetected(*sim, v.deepest);
      if (!hidden.empty()) v.verdict = "silently wrong", v.why = hidden;
      // The watch of a run with a fixed step looks every 8192 steps; here as often in relation to the trial.
      if (t.share_of_limit > 0.0 && v.steps % (4 * chunk) == 0 && sim->time_step() > sim->step_limits().dt_limit) {
        v.verdict = "stopped", v.why = "step above dt_limit";
        break;
      }
      if (t.share_of_limit == 0.0 && v.steps % (4 * chunk) == 0) choose_step(*sim, t.soft_overlap);
      if (!v.verdict.empty()) break;
    }
    if (v.verdict.empty() && v.gain > 0.05) v.verdict = "silently wrong", v.why = fmt::format("energy grew by {:.0f} %", 100.0 * v.gain);
    if (v.verdict.empty() && std::fabs(v.residual) > 0.2) v.verdict = "silently wrong", v.why = fmt::format("energy ledger open by {:.0f} %", 100.0 * v.residual);
    if (v.verdict.empty()) v.verdict = "bounded";
  } catch (const std::exception& error) {
    v.verdict = "stopped";
    v.why = error.what();
    if (v.why.size() > 90) v.why = v.why.substr(0, 87) + "...";
  }
  if (sim) v.dt = sim->time_step();
  return v;
}

}  // namespace platen::bench
