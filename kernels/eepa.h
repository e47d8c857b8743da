// Edinburgh elasto-plastic adhesive law between two spheres [Thakur2016, Eq. 1-10; docs/laws.md, "Pairs"].
//
//   s = delta^n;  s_p = plastic overlap to the power n, the history
//   s_p  <- clamp(s_p, (1 - k1/k2) s, (1 + k_adh/k2) s)       loading and adhesive branches [Eq. 2, A2, A3]
//   f_hys = f0 + k2 (s - s_p)                                  [Eq. 2]
//   limit = mu |k2 (s - s_p) + k_adh s|                        [Eq. 10, A11]; or mu |f_hys|, where a case asks for it
//   K1    = n k1 delta^(n-1);  k_t = ratio K1                  [A8]
//   beta_n^2 = 4 z (n+1)/(2n) m* K1;  beta_t^2 = ratio beta_n^2   [Eq. 4, 9, A8]
#pragma once

#include "kernels/five_thirds.h"
#include "kernels/power.h"
#include "kernels/scene.h"
#include "kernels/twice.h"
#include "kernels/vec3.h"
#include "kernels/views.h"

namespace platen {

template <class I>
struct NormalResponse {
  typename I::Real sp;       // s_p after the step [m^n]
  typename I::Real f_hys;    // spring force, positive repels [N]
  typename I::Real height;   // what friction is limited by: f_hys above the adhesive branch, k2 (s - s_p) + k_adh s [N]
};

template <class I>
PLATEN_INLINE typename I::Real power_of(typename I::Real x, double p) {
  alignas(64) double v[I::width];
  I::store(v, x);
  for (int lane = 0; lane < I::width; ++lane) v[lane] = power(v[lane], p);
  return I::load(v);
}

// x^p - y^p; without a power where both are the same.
template <class I>
PLATEN_INLINE typename I::Real power_change(typename I::Real x, typename I::Real y, double p) {
  alignas(64) double a[I::width], b[I::width];
  I::store(a, x), I::store(b, y);
  for (int lane = 0; lane < I::width; ++lane) a[lane] = a[lane] == b[lane] ? 0.0 : power(a[lane], p) - power(b[lane], p);
  return I::load(a);
}

// s = delta^n for delta >= 0.
template <class I, Exponent n>
PLATEN_INLINE typename I::Real overlap_power(typename I::Real delta, const LawConstants& c) {
  if constexpr (n == Exponent::one)
    return delta;
  else if constexpr (n == Exponent::three_halves)
    return delta * I::sqrt(delta);
  else
    return power_of<I>(delta, c.exponent);
}

// K1 = n k1 delta^(n-1), the slope of the loading branch [N/m].
template <class I, Exponent n>
PLATEN_INLINE typename I::Real loading_slope(typename I::Real delta, const LawConstants& c) {
  if constexpr (n == Exponent::one)
    return I::set(c.k1);
  else if constexpr (n == Exponent::three_halves)
    return I::set(1.5 * c.k1) * I::sqrt(delta);
  else
    return I::set(c.exponent * c.k1) * power_of<I>(I::max(delta, I::set(c.overlap_floor)), c.exponent - 1.0);
}

template <class I, SceneTraits scene>
PLATEN_INLINE NormalResponse<I> normal_response(typename I::Real s, typename I::Real sp_old, const LawConstants& c) {
  using Real = typename I::Real;
  Real sp = I::set(0.0);
  if constexpr (scene.plasticity) {
    Real upper = s;
    if constexpr (scene.adhesion) upper = I::set(c.sp_upper) * s;
    sp = I::min(I::max(sp_old, I::set(c.sp_lower) * s), upper);
  }
  const Real elastic = I::set(c.k2) * (s - sp);
  Real f_hys = elastic, height = elastic;
  if constexpr (scene.adhesion) {
    f_hys = elastic + I::set(c.f0);
    height = (elastic + I::set(c.limit_f)) + I::set(c.limit_k) * s;
  }
  return {sp, f_hys, height};
}

// The stored tangential spring, turned into the tangent plane of normal n with its length kept [Eq. 6]; was2 = |T_old|^2.
template <class I, bool exact>
PLATEN_INLINE Vec3<I> turned_spring(const Vec3<I>& T_old, const Vec3<I>& n, const typename I::Real& was2) {
  using Real = typename I::Real;
  const Vec3<I> flat = sub_scaled<I>(T_old, dot(T_old, n), n);
  const Real product = was2 * dot(flat, flat);
  // length/|flat| = length^2 / sqrt(length^2 |flat|^2); springs too small to square are not stretched.
  const Real tiny = I::set(0x1p-900);
  return scale<I>(I::where(product > tiny, was2 * inverse_sqrt<I, exact>(I::max(product, tiny)), I::set(1.0)), flat);
}

// Where a spring T, |T|^2 = size2, is at its limit [Eq. 10]. Also where both are 0 (no dashpot on a frictionless contact), and where a
// spring is no number: its loss is no number then, which the sum of energies shows.
template <class I>
PLATEN_INLINE typename I::Mask slides_at(const typename I::Real& limit, const typename I::Real& size2) {
  return I::not_less(size2, limit * limit);
}
// Whether any of these contacts slides; what is not touching counts for nothing. In a bed that holds few do: of four mostly none, which a
// branch is worth, of sixteen mostly some, and nobody asks.
template <class I>
PLATEN_INLINE bool some_slide(const typename I::Mask& slides, const typename I::Mask& touching) {
  if constexpr (interleaved<I>)
    return true;
  else
    return I::any(I::both(slides, touching));
}
// What is left of it, 0..1; of a pair that is not touching any number.
template <class I, bool exact>
PLATEN_INLINE typename I::Real cut_to(const typename I::Real& limit, const typename I::Real& size2, const typename I::Mask& slides, bool some) {
  if (!some) return I::set(1.0);
  return I::where(slides, limit * inverse_sqrt<I, exact>(I::max(size2, I::set(0x1p-900))), I::set(1.0));
}

// 2 k_t times the energy that sliding takes where T, |T|^2 = size2, is cut to T_new = back T: the work of the mean of the
// turned and the new spring over the slip that did not stretch it, (turned + T_new) . (T - T_new), with along = turned . T [N2].
template <class I>
PLATEN_INLINE typename I::Real sliding_loss(const typename I::Mask& slides, bool some, const typename I::Real& back, const typename I::Real& size2, const typename I::Real& along) {
  if (!some) return I::set(0.0);
  return I::where(slides, (I::set(1.0) - back) * I::fma(back, size2, along), I::set(0.0));
}

// Energy that plastic flow takes when s_p goes from `sp_old` to `sp`: a function of s_p alone, hence exact for any step
// [docs/laws.md, "Energy"].
template <class I, Exponent n>
PLATEN_INLINE typename I::Real plastic_dissipation(typename I::Real sp_old, typename I::Real sp, const LawConstants& c) {
  using Real = typename I::Real;
  const Real weight = I::where(sp > sp_old, I::set(c.plastic_loading), I::set(c.plastic_adhesive));
  if constexpr (n == Exponent::one) {
    return weight * ((sp - sp_old) * (sp + sp_old));
  } else if constexpr (n == Exponent::three_halves) {
    return weight * (five_thirds<I>(sp) - five_thirds<I>(sp_old));
  } else {
    const double p = (c.exponent + 1.0) / c.exponent;
    return weight * power_change<I>(sp, sp_old, p);  // most plastic overlaps stand still in most steps
  }
}

}  // namespace platen
