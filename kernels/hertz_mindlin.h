// Hertz-Mindlin contact between a sphere and a plane, total form [EDEM; A16, A17 in docs/laws.md, "Plates"].
//
//   F_s = 4/3 E* sqrt(R) delta^1.5      S_n = 2 E* sqrt(R delta)      S_t = 8 G* sqrt(R delta)
//   F_n = F_s - c_n v_n                 c^2 = 4 (5/6) z m S
//   xi += v_t dt, cut to mu F_s/S_t     F_t = -S_t xi - c_t v_t, without c_t while cut
#pragma once

#include "kernels/vec3.h"
#include "kernels/views.h"

namespace platen {

template <class I>
struct PlateResponse {
  typename I::Real spring_force;   // F_s [N]
  typename I::Real normal_force;   // F_n with damping [N]
  Vec3<I> tangential_force;        // F_t [N]
  Vec3<I> xi;                      // elongation after the step [m]
  typename I::Real stiffness_t;    // S_t [N/m]
  typename I::Real c_n, c_t;       // dashpots [N s/m]; c_t is 0 while cut
  typename I::Real slip_old, slip_new;  // (xi_old, xi_new) . slip of the sliding surface [m2]
};

// delta >= 0; v_n > 0 where sphere and plane part; v_t tangential velocity of the sphere's surface against the plane.
template <class I, bool exact>
PLATEN_INLINE PlateResponse<I> plate_response(typename I::Real delta, typename I::Real R, typename I::Real m,
                                              typename I::Real v_n, const Vec3<I>& v_t, const Vec3<I>& xi_old,
                                              const PlateConstants& c) {
  using Real = typename I::Real;
  const Real root = I::sqrt(R * delta);
  const Real F_s = (I::set(c.hertz) * root) * delta;
  const Real S_n = I::set(c.stiffness_n) * root, S_t = I::set(c.stiffness_t) * root;
  const Real damped_mass = I::set(c.damping) * m;
  const Real c_n = I::sqrt(damped_mass * S_n), c_t = I::sqrt(damped_mass * S_t);

  const Vec3<I> trial = add_scaled<I>(xi_old, I::set(c.dt), v_t);
  const Real trial2 = dot(trial, trial);
  const Real longest = I::set(c.slip_ratio) * delta, longest2 = longest * longest;
  const auto cut = trial2 >= longest2;
  const Real tiny = I::set(0x1p-900);
  const Real back = I::where(cut, longest * inverse_sqrt<I, exact>(I::max(trial2, tiny)), I::set(1.0));
  const Vec3<I> xi = scale<I>(back, trial);
  const Real c_t_now = I::where(cut, I::set(0.0), c_t);
  const Vec3<I> F_t = add_scaled<I>(scale<I>(-S_t, xi), -c_t_now, v_t);
  const Real over = I::where(cut, I::set(1.0) - back, I::set(0.0));
  return {F_s, F_s - c_n * v_n, F_t, xi, S_t, c_n, c_t_now, over * dot(xi_old, trial), over * (back * trial2)};
}

}  // namespace platen
