#include "protocol/guards.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace platen {

namespace {

// The sphere that is not anywhere or farthest out.
std::string farthest_sphere(const Particles& p) {
  const std::vector<std::int32_t> places = p.places();
  std::size_t found = places.size();
  double most = -1.0;
  for (std::size_t rank = 0; rank < places.size(); ++rank) {
    const auto k = static_cast<std::size_t>(places[rank]);
    const double sum = std::fabs(p.x[k]) + std::fabs(p.y[k]) + std::fabs(p.z[k]);
    const double all = sum + p.vx[k] + p.vy[k] + p.vz[k] + p.ux[k] + p.uy[k] + p.uz[k];
    const double far = std::isfinite(all) ? sum : std::numeric_limits<double>::infinity();
    if (far > most) most = far, found = rank;
  }
  if (found == places.size()) return "";
  const auto k = static_cast<std::size_t>(places[found]);
  return fmt::format("; sphere {} at ({:g}, {:g}, {:g}) m moves at ({:g}, {:g}, {:g}) m/s", p.id_of_rank[found],
                     p.x[k], p.y[k], p.z[k], p.vx[k], p.vy[k], p.vz[k]);
}

std::string fastest_turning_sphere(const Particles& p) {
  std::string text;
  double most = -1.0;
  const std::vector<std::int32_t> places = p.places();
  for (std::size_t rank = 0; rank < places.size(); ++rank) {
    const auto k = static_cast<std::size_t>(places[rank]);
    const double spin = std::sqrt(p.ux[k] * p.ux[k] + p.uy[k] * p.uy[k] + p.uz[k] * p.uz[k]) / p.radius_of(places[rank]);
    if (spin > most) most = spin, text = fmt::format("; sphere {} at ({:g}, {:g}, {:g}) m turns at {:g} rad/s", p.id_of_rank[rank], p.x[k], p.y[k], p.z[k], spin);
  }
  return text;
}

}  // namespace

double size_of_space(const Case& c, const Simulation& sim) {
  const Particles& p = sim.state();
  double size = std::max({c.box.width, c.box.depth, c.box.height, 2.0 * sim.largest_radius()});
  for (std::size_t k = 0; k < static_cast<std::size_t>(p.count); ++k) size = std::max({size, std::fabs(p.x[k]), std::fabs(p.y[k]), std::fabs(p.z[k])});
  return size;
}

void refuse_fast_spins(const Simulation& sim, const Measures& m) {
  const double turn = m.fastest_spin * sim.time_step();
  if (turn > 0.5)
    throw RunError(fmt::format("a sphere turns by {:.3g} rad in one step at step {} (t = {:.6g} s): more than springs and rolling can follow{}; use a smaller time step",
                               turn, m.step, m.time, fastest_turning_sphere(sim.state())));
}

void refuse_lost_spheres(const Simulation& sim, const Measures& m, double farthest_allowed) {
  if (m.farthest <= farthest_allowed) return;
  throw RunError(fmt::format("a sphere is lost at step {} (t = {:.6g} s){}: {}; plates, walls or periodic sides keep spheres in, a smaller time step or lower speeds keep them slow",
                             m.step, m.time, farthest_sphere(sim.state()),
                             std::isnan(m.farthest) ? std::string("a position or velocity is not a number") : fmt::format("farther out than 1000 times the box, {:.4g} m", farthest_allowed)));
}

}  // namespace platen
