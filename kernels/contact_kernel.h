// One pass over the pairs that a batch owns: fetch -> law -> output [docs/architecture.md, "The contact kernel"].
#pragma once

#include "kernels/eepa.h"
#include "kernels/rolling.h"

namespace platen {

// Geometry and relative motion of `width` pairs. The normal points from j to i.
template <class I>
struct Pairs {
  typename I::Real delta;                    // overlap [m]
  Vec3<I> n;                                 // unit normal
  typename I::Real v_n;                      // normal relative velocity, positive when parting [m/s]
  Vec3<I> v_t;                               // tangential relative velocity at the contact point [m/s]
  typename I::Real lever_i, lever_j;         // a/R [-]
  typename I::Real R_i, R_j, m_i, m_j;       // unequal spheres only
  Vec3<I> w;                                 // relative spin [rad/s], relative rolling only
};

// Contributions of `width` pairs: force on i, and for each side torque over radius and rolling strength.
template <class I>
struct PairForces {
  Vec3<I> F, T_i, T_j;
  typename I::Real S_i, S_j;
  typename I::Mask touching;
};

// Consecutive contacts share owners, and owners follow each other along the curve: eight contacts mostly have theirs
// within eight places, which one load and one permutation per field bring.
template <class I, SceneTraits scene>
PLATEN_INLINE void fetch_owners(const PairBatch& b, std::int32_t k, typename I::Real (&x)[4], typename I::Real (&v)[4],
                                typename I::Real (&u)[4]) {
  if constexpr (I::picks && scene.equal_spheres) {
    const std::int32_t base = b.i[k];
    if (b.i[k + I::width - 1] - base < I::width && base + I::width <= b.end) {
      const auto where = I::places(b.i + k, base);
      x[0] = I::pick(b.x + base, where), x[1] = I::pick(b.y + base, where), x[2] = I::pick(b.z + base, where);
      v[0] = I::pick(b.vx + base, where), v[1] = I::pick(b.vy + base, where), v[2] = I::pick(b.vz + base, where);
      u[0] = I::pick(b.ux + base, where), u[1] = I::pick(b.uy + base, where), u[2] = I::pick(b.uz + base, where);
      return;
    }
  }
  I::fetch4(b.rows, b.i + k, 0, x);
  I::fetch4(b.rows, b.i + k, 4, v);
  I::fetch4(b.rows, b.i + k, 8, u);
}

template <class I, SceneTraits scene, bool exact>
PLATEN_INLINE Pairs<I> fetch_pairs(const PairBatch& b, const LawConstants& c, std::int32_t k) {
  using Real = typename I::Real;
  Real xi[4], xj[4], vi[4], vj[4], ui[4], uj[4];
  I::fetch4(b.rows, b.j + k, 0, xj);
  I::fetch4(b.rows, b.j + k, 4, vj);
  I::fetch4(b.rows, b.j + k, 8, uj);
  fetch_owners<I, scene>(b, k, xi, vi, ui);
  Pairs<I> p;
  // Nearest image: an odd function that changes no bit of a pair inside the box, or when the lengths are 0.
  Vec3<I> d = {xi[0] - xj[0], xi[1] - xj[1], xi[2] - xj[2]};
  d.x = I::fma(I::set(-c.width), I::round(d.x * I::set(c.inverse_width)), d.x);
  d.y = I::fma(I::set(-c.depth), I::round(d.y * I::set(c.inverse_depth)), d.y);
  const Real distance2 = dot(d, d);
  const Real inverse = inverse_sqrt<I, exact>(distance2);
  p.n = scale<I>(inverse, d);
  Real inverse_R_i, inverse_R_j, reach;
  if constexpr (scene.equal_spheres) {
    reach = I::set(c.radius + c.radius);
    inverse_R_i = inverse_R_j = I::set(c.inverse_radius);
  } else {
    p.R_i = xi[3], p.R_j = xj[3], p.m_i = vi[3], p.m_j = vj[3];
    reach = p.R_i + p.R_j;
    inverse_R_i = ui[3], inverse_R_j = uj[3];
  }
  p.delta = reach - distance2 * inverse;
  const Real half = I::set(0.5) * p.delta;
  p.lever_i = I::set(1.0) - half * inverse_R_i;
  if constexpr (scene.equal_spheres)
    p.lever_j = p.lever_i;
  else
    p.lever_j = I::set(1.0) - half * inverse_R_j;
  const Vec3<I> v = {vi[0] - vj[0], vi[1] - vj[1], vi[2] - vj[2]};
  // Written per side in every scene, and symmetric in i and j to the last bit.
  const Vec3<I> u_i = {ui[0], ui[1], ui[2]}, u_j = {uj[0], uj[1], uj[2]};
  const Vec3<I> spin = scale<I>(p.lever_i, u_i) + scale<I>(p.lever_j, u_j);
  p.v_n = dot(v, p.n);
  p.v_t = add_scaled<I>(v, -p.v_n, p.n) + cross(p.n, spin);
  if constexpr (scene.rolling == Rolling::relative) p.w = scale<I>(inverse_R_i, u_i) - scale<I>(inverse_R_j, u_j);
  return p;
}

// Forces of `width` pairs; reads and advances their history, adds their energies.
template <class I, SceneTraits scene, bool exact>
PLATEN_INLINE PairForces<I> pair_forces(const Pairs<I>& p, const PairBatch& b, const LawConstants& c, std::int32_t k,
                                        typename I::Real (&energy)[term_count]) {
  using Real = typename I::Real;
  const Real zero = I::set(0.0);
  PairForces<I> out;
  out.touching = p.delta > zero;
  const Real delta = I::where(out.touching, p.delta, zero);

  // normal
  const Real s = overlap_power<I, scene.exponent>(delta, c);
  const Real sp_old = scene.plasticity ? I::load(b.sp + k) : zero;
  const NormalResponse<I> normal = normal_response<I, scene>(s, sp_old, c);
  Real beta_n, k_t;
  if constexpr (scene.exponent == Exponent::one && scene.equal_spheres) {
    beta_n = I::set(c.beta_n);
    k_t = I::set(c.k_t);
  } else {
    static_assert(!scene.equal_spheres, "other exponents are built for unequal spheres only");
    const Real m = (p.m_i * p.m_j) / (p.m_i + p.m_j);
    const Real K1 = loading_slope<I, scene.exponent>(delta, c);
    beta_n = I::sqrt(I::set(c.damping) * m * K1);
    k_t = I::set(c.ratio) * K1;
  }
  const Real beta_t = beta_n * I::set(c.beta_ratio);
  const Real f_n = normal.f_hys - beta_n * p.v_n;

  // tangential
  const Vec3<I> T_old = {I::load(b.tx + k), I::load(b.ty + k), I::load(b.tz + k)};
  const Real limit = I::set(c.mu) * I::abs(normal.height);
  const TangentialResponse<I> tangential = tangential_response<I, exact>(T_old, p.n, p.v_t, k_t, limit, c.dt);
  const Vec3<I> F_t = add_scaled<I>(tangential.spring, I::where(tangential.cut, zero, -beta_t), p.v_t);

  const Vec3<I> none = {zero, zero, zero};
  const Vec3<I> T_new = where<I>(out.touching, tangential.spring, none);
  if constexpr (scene.plasticity) I::store(b.sp + k, normal.sp);  // 0 when apart, since s = 0
  I::store(b.tx + k, T_new.x), I::store(b.ty + k, T_new.y), I::store(b.tz + k, T_new.z);

  // contributions
  // Masked last: padding has no distance, and what it computes is not a number.
  out.F = where<I>(out.touching, add_scaled<I>(F_t, f_n, p.n), none);
  const Vec3<I> turn = cross(p.n, F_t);
  out.T_i = where<I>(out.touching, scale<I>(-p.lever_i, turn), none);
  if constexpr (!scene.equal_spheres) out.T_j = where<I>(out.touching, scale<I>(-p.lever_j, turn), none);
  const Real strength = I::abs(normal.f_hys);
  out.S_i = out.S_j = zero;
  if constexpr (scene.rolling == Rolling::absolute) {
    out.S_i = I::where(out.touching, strength * p.lever_i, zero);
    if constexpr (!scene.equal_spheres) out.S_j = I::where(out.touching, strength * p.lever_j, zero);
  }
  if constexpr (scene.rolling == Rolling::relative) {
    const Real inertia_i = I::set(0.4) * p.m_i * (p.R_i * p.R_i), inertia_j = I::set(0.4) * p.m_j * (p.R_j * p.R_j);
    const Vec3<I> torque = relative_rolling_torque<I, exact>(p.w, I::set(c.mu_r) * strength, p.lever_i * p.R_i,
                                                             p.lever_j * p.R_j, inertia_i, inertia_j, c.rolling_share,
                                                             c.dt);
    const Vec3<I> M = where<I>(out.touching, torque, none);
    out.T_i = add_scaled<I>(out.T_i, I::set(1.0) / p.R_i, M);
    out.T_j = add_scaled<I>(out.T_j, -(I::set(1.0) / p.R_j), M);
    if constexpr (scene.energy) energy[term_rolling] = zero - dot(M, p.w) * I::set(c.dt);
  }

  if constexpr (scene.energy) {
    // A dashpot's work in a step is c v(n-1/2) v(n) dt; v(n) is not known yet. Summed by parts that is, to second
    // order, v(n-1/2)^2 (3/4 c(n) + 1/4 c(n-1)) dt: also in the step in which the spheres part [docs/laws.md, "Energy"].
    const Real old2 = dot(T_old, T_old);
    const auto was_touching = I::fma(p.v_n, I::set(c.dt), p.delta) > zero;
    const auto sticking = I::negate(tangential.cut);
    const Real now = I::set(0.75 * c.dt), before = I::set(0.25 * c.dt);
    const Real normal_share = I::where(out.touching, now, zero) + I::where(was_touching, before, zero);
    const Real tangential_share = I::where(sticking, normal_share, zero);
    const Real viscous = (beta_n * normal_share) * (p.v_n * p.v_n) + (beta_t * tangential_share) * dot(p.v_t, p.v_t);
    energy[term_viscous] = I::where(I::either(out.touching, was_touching), viscous, zero);
    if constexpr (scene.plasticity)
      energy[term_plastic] = plastic_dissipation<I, scene.exponent>(sp_old, normal.sp, c);
    if constexpr (scene.exponent == Exponent::one) {
      const Real slid = I::where(out.touching, tangential.loss, old2);
      energy[term_sliding] = slid * I::set(c.half_over_k_t);
    } else {
      // The spring's energy |T|^2/(2 k_t) also changes with k_t(delta): that part is no work of any force [A17].
      const Real k_t_last = I::load(b.k_t_last + k), half = I::set(0.5);
      const Real flexible_last = I::where(k_t_last > zero, half / k_t_last, zero);
      const Real flexible = I::where(out.touching, half / k_t, zero);
      energy[term_sliding] =
          I::where(out.touching, tangential.loss * flexible, old2 * flexible_last);
      energy[term_model] = I::where(out.touching, old2 * (flexible - flexible_last), zero);
      I::store(b.k_t_last + k, I::where(out.touching, k_t, zero));
    }
  }
  return out;
}

template <class I>
PLATEN_INLINE typename I::Real rounded(typename I::Real x, const Quantum& q) {
  const typename I::Real magic = I::set(q.magic);
  return (x + magic) - magic;
}

// Rounds the contributions, turns them into records and adds them up: the owner's by a sum carried from contact to
// contact (consecutive contacts share owners), the partner's into its slot.
template <class I, SceneTraits scene>
PLATEN_INLINE void output_pairs(const PairForces<I>& f, const PairBatch& b, const LawConstants& c, std::int32_t k,
                                typename I::Record& carried, std::int32_t& owner) {
  using Real = typename I::Real;
  const Real zero = I::set(0.0);
  const auto pack = [&](const Vec3<I>& T, Real S, typename I::Record(&records)[I::width]) {
    const Real fields[8] = {rounded<I>(f.F.x, c.force), rounded<I>(f.F.y, c.force), rounded<I>(f.F.z, c.force),
                            rounded<I>(S, c.force),     rounded<I>(T.x, c.force),   rounded<I>(T.y, c.force),
                            rounded<I>(T.z, c.force),   zero};
    I::to_records(fields, records);
  };
  typename I::Record on_i[I::width];
  pack(f.T_i, f.S_i, on_i);
  typename I::Record on_j[I::width];
  if constexpr (!scene.equal_spheres) pack(f.T_j, f.S_j, on_j);
  for (int lane = 0; lane < I::width; ++lane) {
    const std::int32_t i = b.i[k + lane];
    carried = I::add(I::keep(i == owner, carried), on_i[lane]);
    owner = i;
    I::store_record(b.sum_i + record_size * static_cast<std::int64_t>(i - b.first), carried);
    double* slot = b.sum_j + record_size * static_cast<std::int64_t>(b.slot_j[k + lane]);
    I::store_record(slot, I::add(I::load_record(slot), I::react(scene.equal_spheres ? on_i[lane] : on_j[lane])));
  }
}

// Which energy terms pairs of a scene have at all.
constexpr bool has_term(const SceneTraits& scene, int term) {
  switch (term) {
    case term_plastic: return scene.plasticity;
    case term_rolling: return scene.rolling == Rolling::relative;  // absolute: in the motion kernel
    case term_model: return scene.exponent != Exponent::one;
    default: return true;
  }
}

template <class I, SceneTraits scene, bool exact>
void contact_kernel(const PairBatch& b, const LawConstants& c, PairTotals& totals) noexcept {
  using Real = typename I::Real;
  typename I::Record carried = I::zero_record();
  std::int32_t owner = -1;
  std::int64_t contacts = 0;
  bool out_of_range = false;
  const Real force_bound2 = I::set(c.force.bound * c.force.bound), energy_bound = I::set(c.energy.bound);
  for (std::int32_t start = 0; start < b.count; start += chunk_size) {
    const std::int32_t end = start + chunk_size < b.count ? start + chunk_size : b.count;
    Real sums[term_count];
    for (Real& sum : sums) sum = I::set(0.0);
    for (std::int32_t k = start; k < end; k += I::width) {
      const Pairs<I> pairs = fetch_pairs<I, scene, exact>(b, c, k);
      Real energy[term_count];
      for (Real& term : energy) term = I::set(0.0);
      const PairForces<I> forces = pair_forces<I, scene, exact>(pairs, b, c, k, energy);
      output_pairs<I, scene>(forces, b, c, k, carried, owner);
      contacts += I::count(forces.touching);
      // Written so that a NaN counts as out of range.
      const Real size2 = I::max(dot(forces.F, forces.F), forces.S_i * forces.S_i);
      auto fine = I::both(size2 < force_bound2, dot(forces.F, forces.F) < force_bound2);
      // An overlap above R, the centre of one sphere deep inside the other, is no contact any more: a lever below R/2.
      const auto shallow = I::both(pairs.lever_i >= I::set(0.5), pairs.lever_j >= I::set(0.5));
      fine = I::both(fine, I::either(I::negate(forces.touching), shallow));
      if constexpr (scene.energy) {
        Real largest = I::set(0.0);
        for (int term = 0; term < term_count; ++term)
          if (has_term(scene, term)) {
            largest = largest + I::abs(energy[term]);
            sums[term] = sums[term] + rounded<I>(energy[term], c.energy);
          }
        fine = I::both(fine, largest < energy_bound);
      }
      out_of_range = out_of_range || I::any(I::negate(fine));
    }
    if constexpr (scene.energy)
      for (int term = 0; term < term_count; ++term)
        if (has_term(scene, term)) totals.energy[term] += static_cast<std::int64_t>(I::sum(sums[term]) * c.energy.inverse);
  }
  totals.contacts += contacts;
  totals.out_of_range = totals.out_of_range || out_of_range;
}

}  // namespace platen
