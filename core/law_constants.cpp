#include "core/law_constants.h"

#include <cmath>

namespace platen {

double damping_share(double restitution) {
  if (restitution >= 1.0) return 0.0;
  const double ratio = 3.14159265358979323846 / std::log(restitution);
  return 1.0 / (1.0 + ratio * ratio);
}

LawConstants pair_constants(const PairLaw& law) {
  const double n = law.exponent;
  LawConstants c{};
  c.k1 = law.k1, c.k2 = law.k2, c.k_adh = law.k_adh, c.f0 = law.f0, c.exponent = n;
  c.sp_lower = 1.0 - c.k1 / c.k2;
  c.sp_upper = 1.0 + c.k_adh / c.k2;
  c.mu = law.friction, c.mu_r = law.rolling_friction;
  if (law.friction_limit == FrictionLimit::adhesive) c.limit_k = c.k_adh, c.limit_f = 0.0;
  else c.limit_k = 0.0, c.limit_f = c.f0;
  c.ratio = law.tangential_ratio;
  c.k_t = c.ratio * c.k1;
  c.half_over_k_t = c.k_t > 0.0 ? 0.5 / c.k_t : 0.0;
  c.damping = 4.0 * damping_share(law.restitution) * ((n + 1.0) / (2.0 * n));
  c.beta_ratio = std::sqrt(c.ratio);
  const double power = (n + 1.0) / n;
  c.plastic_loading = c.sp_lower > 0.0 ? c.k2 * (std::pow(c.sp_lower, -1.0 / n) - 1.0) / power : 0.0;
  c.plastic_adhesive = c.k2 * (std::pow(c.sp_upper, -1.0 / n) - 1.0) / power;
  return c;
}

PlateConstants plate_constants(const PlateLaw& law) {
  const double nu_s = law.particle_poisson_ratio, nu_p = law.poisson_ratio;
  const double E_s = law.particle_young_modulus, E_p = law.young_modulus;
  const double G_s = E_s / (2.0 * (1.0 + nu_s)), G_p = E_p / (2.0 * (1.0 + nu_p));
  const double E_star = 1.0 / ((1.0 - nu_s * nu_s) / E_s + (1.0 - nu_p * nu_p) / E_p);
  const double G_star = 1.0 / ((2.0 - nu_s) / G_s + (2.0 - nu_p) / G_p);
  PlateConstants p{};
  p.hertz = 4.0 / 3.0 * E_star;
  p.stiffness_n = 2.0 * E_star;
  p.stiffness_t = 8.0 * G_star;
  p.damping = 4.0 * (5.0 / 6.0) * damping_share(law.restitution);
  p.mu = law.friction, p.mu_r = law.rolling_friction;
  p.normal_to_tangential = std::sqrt(p.stiffness_n / p.stiffness_t);
  p.slip_ratio = p.mu * p.hertz / p.stiffness_t;
  return p;
}

}  // namespace platen
