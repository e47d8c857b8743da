// Rolling friction [Thakur2016, Eq. 11; A12-A14 in docs/laws.md, "Rolling"].
//
// absolute: each body is slowed against its own spin by sum(mu_r |f_hys| a). Summed per body, directed and capped once,
//           after the other torques: |u| <- max(0, |u| - (5/2) (mu_r S + P) dt/m), u = R omega. The cap lets a body come
//           to rest exactly instead of trembling around it.
// relative: each pair is slowed against its relative spin w = omega_i - omega_j by the torque mu_r |f_hys| a*,
//           a* = a_i a_j/(a_i + a_j), equal and opposite, capped at a share of what would stop the relative spin.
#pragma once

#include "kernels/vec3.h"
#include "kernels/views.h"

namespace platen {

// Spin after rolling friction took `loss` [m/s] off its magnitude. Exactly `u` when loss is 0 and u is not.
template <class I>
PLATEN_INLINE Vec3<I> slowed_spin(const Vec3<I>& u, typename I::Real loss) {
  using Real = typename I::Real;
  const Real size = I::sqrt(dot(u, u));
  const Real left = I::where(loss < size, (size - loss) / I::max(size, I::set(0x1p-900)), I::set(0.0));
  return scale<I>(left, u);
}

// Torque on body i of a pair, relative model [N m]; on j its opposite.
template <class I, bool exact>
PLATEN_INLINE Vec3<I> relative_rolling_torque(const Vec3<I>& w, typename I::Real strength, typename I::Real a_i,
                                              typename I::Real a_j, typename I::Real inertia_i,
                                              typename I::Real inertia_j, double share, double dt) {
  using Real = typename I::Real;
  const Real tiny = I::set(0x1p-900);
  const Real inverse = inverse_sqrt<I, exact>(I::max(dot(w, w), tiny));
  const Real torque = strength * ((a_i * a_j) / (a_i + a_j)) * inverse;
  const Real effective = (inertia_i * inertia_j) / (inertia_i + inertia_j);
  const Real cap = dt > 0.0 ? effective * I::set(share / dt) : I::set(0.0);
  return scale<I>(-I::min(torque, cap), w);
}

}  // namespace platen
