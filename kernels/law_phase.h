// Second phase of the contact kernel: forces and history of pairs, and what they take out of the ledger.
#pragma once

#include "kernels/active_pairs.h"
#include "kernels/eepa.h"
#include "kernels/rolling.h"
#include "kernels/rounding.h"
#include "kernels/twice.h"

namespace platen {

// What pairs take out of the ledger in a step [J]; order-free sums.
template <class I>
struct PairEnergies {
  typename I::Real plastic, viscous, sliding, rolling, model;
};

// Sums over the pairs of a chunk, on single vectors also where the law works on two at once.
template <class I>
struct ChunkSums {
  using Sum = typename SingleOf<I>::Type;
  PairEnergies<Sum> energy = {Sum::set(0.0), Sum::set(0.0), Sum::set(0.0), Sum::set(0.0), Sum::set(0.0)};
  int contacts = 0;

  PLATEN_INLINE void add(typename Sum::Real PairEnergies<Sum>::*term, const typename I::Real& value, const LawConstants& c) {
    energy.*term = energy.*term + SingleOf<I>::sum(rounded<I>(value, c.energy));
  }
};

// With exponent 1, K1 and k_t are the same for all pairs, and among equal spheres so is beta_n.
template <SceneTraits scene>
inline constexpr bool common_k_t = scene.exponent == Exponent::one;
template <SceneTraits scene>
inline constexpr bool common_beta_n = scene.exponent == Exponent::one && scene.equal_spheres;

// First third of the law: of `width` pairs from position `at` of a chunk on, the normal force, what it limits, and the
// tangential spring turned with the normal. Advances the plastic overlap and adds what that takes.
//
// Three loops, since each pair is one long chain of dependent operations with two inverse roots in it: with all of it in one
// loop a processor sees too few pairs at a time to fill the waits [docs/decisions.md, "Fetch and law in two halves", "The output is short of
// instructions, the law of room"].
template <class I, SceneTraits scene, bool exact>
PLATEN_INLINE void springs_of_pairs(Chunk<scene>& chunk, int at, const PairBatch& b, const LawConstants& c, std::int32_t k,
                                    ChunkSums<I>& sums) {
  using Real = typename I::Real;
  using Energy = PairEnergies<typename SingleOf<I>::Type>;
  const PairsOfChunk<I, scene> pairs(chunk, at);
  const Real zero = I::set(0.0);
  const auto touching = pairs.delta() > zero;
  sums.contacts += I::count(touching);

  // spring before its advance [Eq. 6]
  const Vec3<I> T_old = {I::load(b.tx + k), I::load(b.ty + k), I::load(b.tz + k)};
  const Real was2 = dot(T_old, T_old);
  chunk.template put<I>(chunk.turned, at, turned_spring<I, exact>(T_old, pairs.n(), was2));
  if constexpr (scene.energy && scene.exponent == Exponent::one) {
    // Springs of pairs that have parted; few ever do.
    if (I::any(I::negate(I::either(touching, zero >= was2))))  // also one that is no number
      sums.add(&Energy::sliding, I::where(touching, zero, was2) * I::set(c.half_over_k_t), c);
  }

  // f_hys [Eq. 2], F_n [Eq. 1, 3, 4], limit [Eq. 10, A11]
  const Real s = overlap_power<I, scene.exponent>(I::where(touching, pairs.delta(), zero), c);
  const Real sp_old = scene.plasticity ? I::load(b.sp + k) : zero;
  const NormalResponse<I> normal = normal_response<I, scene>(s, sp_old, c);
  if constexpr (scene.plasticity) {
    I::store(b.sp + k, normal.sp);  // 0 when apart, since s = 0
    if constexpr (scene.energy) sums.add(&Energy::plastic, plastic_dissipation<I, scene.exponent>(sp_old, normal.sp, c), c);
  }
  Real beta_n;
  if constexpr (common_beta_n<scene>) {
    beta_n = I::set(c.beta_n);
  } else {
    static_assert(!scene.equal_spheres, "other exponents are built for unequal spheres only");
    const Real m_i = pairs.m(0), m_j = pairs.m(1), m = (m_i * m_j) / (m_i + m_j);
    const Real K1 = loading_slope<I, scene.exponent>(I::where(touching, pairs.delta(), zero), c);
    beta_n = I::sqrt(I::set(c.damping) * m * K1);
    I::store(chunk.beta_n + at, beta_n);
    if constexpr (!common_k_t<scene>) I::store(chunk.k_t + at, I::set(c.ratio) * K1);
  }
  I::store(chunk.f_n + at, normal.f_hys - beta_n * pairs.v_n());
  I::store(chunk.limit + at, I::set(c.mu) * I::abs(normal.height));
  const Real strength = I::abs(normal.f_hys);
  if constexpr (scene.rolling == Rolling::absolute) {
    I::store(chunk.S[0] + at, I::where(touching, strength * pairs.lever(0), zero));
    if constexpr (!scene.equal_spheres) I::store(chunk.S[1] + at, I::where(touching, strength * pairs.lever(1), zero));
  } else if constexpr (scene.rolling == Rolling::relative) {
    I::store(chunk.S[0] + at, strength);  // for the last third
  }
}

// Second third: the spring's advance and its limit, and what sliding takes.
template <class I, SceneTraits scene, bool exact>
PLATEN_INLINE void slips_of_pairs(Chunk<scene>& chunk, int at, const PairBatch& b, const LawConstants& c, std::int32_t k,
                                  ChunkSums<I>& sums) {
  using Real = typename I::Real;
  using Energy = PairEnergies<typename SingleOf<I>::Type>;
  const PairsOfChunk<I, scene> pairs(chunk, at);
  const Real zero = I::set(0.0);
  const Vec3<I> none = {zero, zero, zero};
  const auto touching = pairs.delta() > zero;
  const Real k_t = common_k_t<scene> ? I::set(c.k_t) : pairs.k_t();

  // spring and its limit [Eq. 6, 7, 10]
  const Vec3<I> T = sub_scaled<I>(pairs.turned(), k_t * I::set(c.dt), pairs.v_t());
  const Real size2 = dot(T, T);
  const Real limit = pairs.limit();
  const auto slides = slides_at<I>(limit, size2);
  const bool some = some_slide<I>(slides, touching);
  const Real back = cut_to<I, exact>(limit, size2, slides, some);
  const Vec3<I> T_new = where<I>(touching, scale<I>(back, T), none);
  if constexpr (scene.energy) {
    const Real loss = sliding_loss<I>(slides, some, back, size2, dot(pairs.turned(), T));
    if constexpr (scene.exponent == Exponent::one) {
      sums.add(&Energy::sliding, I::where(touching, loss, zero) * I::set(c.half_over_k_t), c);
    } else {
      // The spring's energy |T|^2/(2 k_t) also changes with k_t(delta): that part is no work of any force [A17].
      const Vec3<I> T_old = {I::load(b.tx + k), I::load(b.ty + k), I::load(b.tz + k)};
      const Real was2 = dot(T_old, T_old), k_t_last = I::load(b.k_t_last + k), half = I::set(0.5);
      const Real flexible_last = I::where(k_t_last > zero, half / k_t_last, zero);
      const Real flexible = I::where(touching, half / k_t, zero);
      sums.add(&Energy::sliding, I::where(touching, loss * flexible, was2 * flexible_last), c);
      sums.add(&Energy::model, I::where(touching, was2 * (flexible - flexible_last), zero), c);
      I::store(b.k_t_last + k, I::where(touching, k_t, zero));
    }
  }
  I::store(b.tx + k, T_new.x), I::store(b.ty + k, T_new.y), I::store(b.tz + k, T_new.z);

  // tangential dashpot: none where the contact slides [Eq. 9, A10]
  const Real beta_n = common_beta_n<scene> ? I::set(c.beta_n) : pairs.beta_n();
  I::store(chunk.beta_t + at, I::where(slides, zero, beta_n * I::set(c.beta_ratio)));
}

// Last third: dashpots, and what goes to each side.
template <class I, SceneTraits scene, bool exact>
PLATEN_INLINE void forces_of_pairs(Chunk<scene>& chunk, int at, const PairBatch& b, const LawConstants& c, std::int32_t k,
                                   ChunkSums<I>& sums) {
  static_assert(scene.rolling != Rolling::relative || !scene.equal_spheres, "relative rolling is built for unequal spheres only");
  using Real = typename I::Real;
  using Energy = PairEnergies<typename SingleOf<I>::Type>;
  const PairsOfChunk<I, scene> pairs(chunk, at);
  const Real zero = I::set(0.0);
  const Vec3<I> none = {zero, zero, zero};
  const auto touching = pairs.delta() > zero;

  // F_t [Eq. 5, 8]
  const Vec3<I> T = {I::load(b.tx + k), I::load(b.ty + k), I::load(b.tz + k)};
  const Real beta_t = I::load(chunk.beta_t + at);
  const Vec3<I> v_t = pairs.v_t();
  const Vec3<I> F_t = sub_scaled<I>(T, beta_t, v_t);
  if constexpr (scene.energy) {
    // A dashpot's work in a step is c v(n-1/2) v(n) dt; v(n) is not known yet. Summed by parts that is, to second
    // order, v(n-1/2)^2 (3/4 c(n) + 1/4 c(n-1)) dt: also in the step in which the spheres part [docs/laws.md, "Energy"].
    const Real v_n = pairs.v_n();
    const auto was_touching = I::fma(v_n, I::set(c.dt), pairs.delta()) > zero;
    const Real now = I::set(0.75 * c.dt), before = I::set(0.25 * c.dt);
    const Real of_now = I::where(touching, now, zero), share = I::where(was_touching, of_now + before, of_now);
    const Real beta_n = common_beta_n<scene> ? I::set(c.beta_n) : pairs.beta_n();
    const Real power = I::fma(beta_t, dot(v_t, v_t), beta_n * (v_n * v_n));
    sums.add(&Energy::viscous, I::where(I::either(touching, was_touching), share * power, zero), c);
  }

  // to each side: F, T = lever n x F_t; rolling [Eq. 11, A12-A14]
  // Masked last: padding has no distance, and what it computes is not a number.
  const Vec3<I> n = pairs.n();
  const Vec3<I> F = rounded_by_law<I>(where<I>(touching, add_scaled<I>(F_t, pairs.f_n(), n), none), c.force);
  chunk.template put<I>(chunk.F, at, F);
  const Vec3<I> turn = minus_cross(n, F_t);
  const Real lever_i = pairs.lever(0);
  Vec3<I> T_i = where<I>(touching, scale<I>(lever_i, turn), none);
  if constexpr (!scene.equal_spheres) {
    const Real lever_j = pairs.lever(1);
    Vec3<I> T_j = where<I>(touching, scale<I>(lever_j, turn), none);
    if constexpr (scene.rolling == Rolling::relative) {
      const Real R_i = pairs.R(0), R_j = pairs.R(1);
      const Real inertia_i = I::set(0.4) * pairs.m(0) * (R_i * R_i), inertia_j = I::set(0.4) * pairs.m(1) * (R_j * R_j);
      const Real strength = I::load(chunk.S[0] + at);
      const Vec3<I> torque = relative_rolling_torque<I, exact>(pairs.w(), I::set(c.mu_r) * strength, lever_i * R_i, lever_j * R_j,
                                                               inertia_i, inertia_j, c.rolling_share, c.dt);
      const Vec3<I> M = where<I>(touching, torque, none);
      T_i = add_scaled<I>(T_i, I::set(1.0) / R_i, M);
      T_j = add_scaled<I>(T_j, -(I::set(1.0) / R_j), M);
      if constexpr (scene.energy) sums.add(&Energy::rolling, zero - dot(M, pairs.w()) * I::set(c.dt), c);
    }
    chunk.template put<I>(chunk.T[1], at, rounded_by_law<I>(T_j, c.force));
  }
  chunk.template put<I>(chunk.T[0], at, rounded_by_law<I>(T_i, c.force));
}

// Calls visit(term, value) for each energy that pairs of a scene have at all.
template <class I, SceneTraits scene, class Visit>
PLATEN_INLINE void for_each_energy(const PairEnergies<I>& energy, const Visit& visit) {
  visit(term_viscous, energy.viscous);
  visit(term_sliding, energy.sliding);
  if constexpr (scene.plasticity) visit(term_plastic, energy.plastic);
  if constexpr (scene.rolling == Rolling::relative) visit(term_rolling, energy.rolling);  // absolute: motion kernel
  if constexpr (scene.exponent != Exponent::one) visit(term_model, energy.model);
}

// Whether a contact of the chunk whose lever on either side is below `watched` is out of its bound [N]. Each contact is
// judged by itself, so that what else its chunk holds does not matter, and rounded, so that it does not matter who rounds. Written so
// that a force that is no number counts as too strong.
template <class I, SceneTraits scene>
bool too_strong(const Chunk<scene>& chunk, const ActiveVectors& active, const Quantum& force, double watched) {
  bool strong = false;
  for (int m = 0; m < active.count; ++m) {
    const int at = active.at[m];
    const Vec3<I> F = rounded<I>(Chunk<scene>::template take<I>(chunk.F, at), force);
    typename I::Real strength2 = dot(F, F), shortest = I::load(chunk.lever[0] + at);
    if constexpr (scene.rolling == Rolling::absolute) {
      const typename I::Real S = I::load(chunk.S[0] + at);
      strength2 = I::fma(S, S, strength2);
    }
    if constexpr (!scene.equal_spheres) shortest = I::min(I::load(chunk.lever[1] + at), shortest);
    const auto within = strength2 < I::set(force.bound * force.bound);
    strong = strong || I::any(I::both(shortest < I::set(watched), I::negate(within)));
  }
  return strong;
}

// Law of a chunk; whether every energy is a number within its bound. (Only benches leave the guards out, to see what they
// cost.)
template <class I, SceneTraits scene, bool exact, bool guarded>
PLATEN_INLINE bool law_of_chunk(Chunk<scene>& chunk, const PairBatch& b, const LawConstants& c, std::int32_t start,
                                const ActiveVectors& active, PairTotals& totals) {
  ChunkSums<I> sums;
  for (int m = 0; m < active.count; ++m)
    springs_of_pairs<I, scene, exact>(chunk, active.at[m], b, c, start + active.at[m], sums);
  for (int m = 0; m < active.count; ++m)
    slips_of_pairs<I, scene, exact>(chunk, active.at[m], b, c, start + active.at[m], sums);
  for (int m = 0; m < active.count; ++m)
    forces_of_pairs<I, scene, exact>(chunk, active.at[m], b, c, start + active.at[m], sums);
  using Sum = typename SingleOf<I>::Type;
  bool fine = true;
  if constexpr (scene.energy) {
    double size = 0.0;
    for_each_energy<Sum, scene>(sums.energy, [&](int term, const typename Sum::Real& sum) {
      const double total = Sum::sum(sum);
      if constexpr (guarded) size += total < 0.0 ? -total : total;
      totals.energy[term] += static_cast<std::int64_t>(total * c.energy.inverse);
    });
    // Beyond this bound sums are not exact. With forces within theirs a contact would have to move radii in one step, so
    // that this is met by histories and speeds that are no numbers, or absurd ones.
    if constexpr (guarded) fine = fine && size < chunk_size / 2 * c.energy.bound;
  }
  totals.contacts += sums.contacts;
  return fine;
}

}  // namespace platen
