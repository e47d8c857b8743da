// One pass over the pairs that a batch owns: fetch -> law -> output [docs/architecture.md, "The contact kernel"].
#pragma once

#include "kernels/eepa.h"
#include "kernels/rolling.h"
#include "kernels/twice.h"

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

// What the phases hand on, for one chunk: small enough to stay in the first cache.
//
//   fetch  ->  delta n v_n v_t lever (R m w)  ->  law  ->  F T S  ->  output
template <SceneTraits scene>
struct Chunk {
  static constexpr int sides = scene.equal_spheres ? 1 : 2;  // of unequal spheres, each has its own
  using Column = double[chunk_size];
  alignas(64) Column delta;
  alignas(64) Column n[3];
  alignas(64) Column v_n;
  alignas(64) Column v_t[3];
  alignas(64) Column lever[sides];
  alignas(64) Column R[2], m[2], w[3];
  alignas(64) Column F[3];
  alignas(64) Column T[sides][3];
  alignas(64) Column S[sides];

  template <class I>
  static PLATEN_INLINE void put(Column (&to)[3], int at, const Vec3<I>& a) {
    I::store(to[0] + at, a.x), I::store(to[1] + at, a.y), I::store(to[2] + at, a.z);
  }
  template <class I>
  static PLATEN_INLINE Vec3<I> take(const Column (&from)[3], int at) {
    return {I::load(from[0] + at), I::load(from[1] + at), I::load(from[2] + at)};
  }

  template <class I>
  PLATEN_INLINE void put_pairs(int at, const Pairs<I>& p) {
    I::store(delta + at, p.delta), I::store(v_n + at, p.v_n), I::store(lever[0] + at, p.lever_i);
    put<I>(n, at, p.n), put<I>(v_t, at, p.v_t);
    if constexpr (!scene.equal_spheres) {
      I::store(lever[1] + at, p.lever_j);
      I::store(R[0] + at, p.R_i), I::store(R[1] + at, p.R_j), I::store(m[0] + at, p.m_i), I::store(m[1] + at, p.m_j);
    }
    if constexpr (scene.rolling == Rolling::relative) put<I>(w, at, p.w);
  }
  template <class I>
  PLATEN_INLINE Pairs<I> take_pairs(int at) const {
    Pairs<I> p;
    p.delta = I::load(delta + at), p.v_n = I::load(v_n + at), p.lever_i = p.lever_j = I::load(lever[0] + at);
    p.n = take<I>(n, at), p.v_t = take<I>(v_t, at);
    if constexpr (!scene.equal_spheres) {
      p.lever_j = I::load(lever[1] + at);
      p.R_i = I::load(R[0] + at), p.R_j = I::load(R[1] + at), p.m_i = I::load(m[0] + at), p.m_j = I::load(m[1] + at);
    }
    if constexpr (scene.rolling == Rolling::relative) p.w = take<I>(w, at);
    return p;
  }
  template <class I>
  PLATEN_INLINE void put_forces(int at, const PairForces<I>& f) {
    put<I>(F, at, f.F), put<I>(T[0], at, f.T_i);
    if constexpr (!scene.equal_spheres) put<I>(T[1], at, f.T_j);
    if constexpr (scene.rolling == Rolling::absolute) {
      I::store(S[0] + at, f.S_i);
      if constexpr (!scene.equal_spheres) I::store(S[1] + at, f.S_j);
    }
  }
  // Fields of the records of one side, in their order.
  template <class I>
  PLATEN_INLINE void take_fields(int at, int side, typename I::Real (&fields)[8]) const {
    for (int axis = 0; axis < 3; ++axis) fields[axis] = I::load(F[axis] + at), fields[4 + axis] = I::load(T[side][axis] + at);
    fields[3] = scene.rolling == Rolling::absolute ? I::load(S[side] + at) : I::set(0.0);
    fields[7] = I::set(0.0);
  }
};

// The owner side. Consecutive contacts share owners, and owners follow each other along the curve: eight contacts mostly have theirs
// within eight places, which one load and one permutation per field bring.
template <class I>
struct Fetched {
  typename I::Real row[12];
};
template <class I>
PLATEN_INLINE Fetched<I> fetch_rows(const double* rows, const std::int32_t* index) {
  Fetched<I> f;
  I::fetch_rows(rows, index, f.row);
  return f;
}
template <class I, SceneTraits scene>
PLATEN_INLINE Fetched<I> fetch_owners(const PairBatch& b, std::int32_t k) {
  if constexpr (requires { typename I::Half; }) {
    const auto first = fetch_owners<typename I::Half, scene>(b, k), second = fetch_owners<typename I::Half, scene>(b, k + I::half);
    Fetched<I> f;
    for (int m = 0; m < 12; ++m) f.row[m] = {first.row[m], second.row[m]};
    return f;
  } else {
    if constexpr (I::picks && scene.equal_spheres) {
      const std::int32_t base = b.i[k];
      if (b.i[k + I::width - 1] - base < I::width && base + I::width <= b.end) {
        const auto where = I::places(b.i + k, base);
        const auto pick = [&](const double* column) { return I::pick(column + base, where); };
        const auto none = I::set(0.0);
        return {{pick(b.x), pick(b.y), pick(b.z), none, pick(b.vx), pick(b.vy), pick(b.vz), none, pick(b.ux), pick(b.uy),
                 pick(b.uz), none}};
      }
    }
    return fetch_rows<I>(b.rows, b.i + k);
  }
}

template <class I, SceneTraits scene, bool exact, bool periodic>
PLATEN_INLINE Pairs<I> fetch_pairs(const PairBatch& b, const LawConstants& c, std::int32_t k) {
  using Real = typename I::Real;
  const Fetched<I> i = fetch_owners<I, scene>(b, k), j = fetch_rows<I>(b.rows, b.j + k);
  Pairs<I> p;
  // Nearest image: an odd function that changes no bit of a pair inside the box.
  Vec3<I> d = {i.row[0] - j.row[0], i.row[1] - j.row[1], i.row[2] - j.row[2]};
  if constexpr (periodic) {
    d.x = I::fnma(I::set(c.width), I::round(d.x * I::set(c.inverse_width)), d.x);
    d.y = I::fnma(I::set(c.depth), I::round(d.y * I::set(c.inverse_depth)), d.y);
  }
  const Real distance2 = dot(d, d);
  const Real inverse = inverse_sqrt<I, exact>(distance2);
  p.n = scale<I>(inverse, d);
  Real inverse_R_i, inverse_R_j, reach;
  if constexpr (scene.equal_spheres) {
    reach = I::set(c.radius + c.radius);
    inverse_R_i = inverse_R_j = I::set(c.inverse_radius);
  } else {
    p.R_i = i.row[3], p.R_j = j.row[3], p.m_i = i.row[7], p.m_j = j.row[7];
    reach = p.R_i + p.R_j;
    inverse_R_i = i.row[11], inverse_R_j = j.row[11];
  }
  p.delta = reach - distance2 * inverse;
  const Real half = I::set(0.5) * p.delta;
  p.lever_i = I::set(1.0) - half * inverse_R_i;
  if constexpr (scene.equal_spheres)
    p.lever_j = p.lever_i;
  else
    p.lever_j = I::set(1.0) - half * inverse_R_j;
  const Vec3<I> v = {i.row[4] - j.row[4], i.row[5] - j.row[5], i.row[6] - j.row[6]};
  // Written per side in every scene, and symmetric in i and j to the last bit.
  const Vec3<I> u_i = {i.row[8], i.row[9], i.row[10]}, u_j = {j.row[8], j.row[9], j.row[10]};
  const Vec3<I> spin = scale<I>(p.lever_i, u_i) + scale<I>(p.lever_j, u_j);
  p.v_n = dot(v, p.n);
  p.v_t = sub_scaled<I>(v, p.v_n, p.n) + cross(p.n, spin);
  if constexpr (scene.rolling == Rolling::relative) p.w = scale<I>(inverse_R_i, u_i) - scale<I>(inverse_R_j, u_j);
  return p;
}

// What `width` pairs take out of the ledger in a step [J].
template <class I>
struct PairEnergies {
  typename I::Real plastic, viscous, sliding, rolling, model;
};

// Forces of `width` pairs; reads and advances their history, finds their energies.
template <class I, SceneTraits scene, bool exact>
PLATEN_INLINE PairForces<I> pair_forces(const Pairs<I>& p, const PairBatch& b, const LawConstants& c, std::int32_t k,
                                        PairEnergies<I>& energy) {
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
  const Vec3<I> F_t = sub_scaled<I>(tangential.spring, I::where(tangential.cut, zero, beta_t), p.v_t);

  const Vec3<I> none = {zero, zero, zero};
  const Vec3<I> T_new = where<I>(out.touching, tangential.spring, none);
  if constexpr (scene.plasticity) I::store(b.sp + k, normal.sp);  // 0 when apart, since s = 0
  I::store(b.tx + k, T_new.x), I::store(b.ty + k, T_new.y), I::store(b.tz + k, T_new.z);

  // contributions
  // Masked last: padding has no distance, and what it computes is not a number.
  out.F = where<I>(out.touching, add_scaled<I>(F_t, f_n, p.n), none);
  const Vec3<I> turn = minus_cross(p.n, F_t);
  out.T_i = where<I>(out.touching, scale<I>(p.lever_i, turn), none);
  if constexpr (!scene.equal_spheres) out.T_j = where<I>(out.touching, scale<I>(p.lever_j, turn), none);
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
    if constexpr (scene.energy) energy.rolling = zero - dot(M, p.w) * I::set(c.dt);
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
    energy.viscous = I::where(I::either(out.touching, was_touching), viscous, zero);
    if constexpr (scene.plasticity)
      energy.plastic = plastic_dissipation<I, scene.exponent>(sp_old, normal.sp, c);
    if constexpr (scene.exponent == Exponent::one) {
      const Real slid = I::where(out.touching, tangential.loss, old2);
      energy.sliding = slid * I::set(c.half_over_k_t);
    } else {
      // The spring's energy |T|^2/(2 k_t) also changes with k_t(delta): that part is no work of any force [A17].
      const Real k_t_last = I::load(b.k_t_last + k), half = I::set(0.5);
      const Real flexible_last = I::where(k_t_last > zero, half / k_t_last, zero);
      const Real flexible = I::where(out.touching, half / k_t, zero);
      energy.sliding =
          I::where(out.touching, tangential.loss * flexible, old2 * flexible_last);
      energy.model = I::where(out.touching, old2 * (flexible - flexible_last), zero);
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
// contact (consecutive contacts share owners), the partner's into its slot. No partner of a run of contacts is their
// owner, so what is carried misses nothing.
template <class I, SceneTraits scene>
PLATEN_INLINE void output_pairs(const Chunk<scene>& chunk, int at, const PairBatch& b, const LawConstants& c,
                                std::int32_t k, const double* nothing, typename I::Record& carried, std::int32_t& owner) {
  typename I::Record records[Chunk<scene>::sides][I::width];
  for (int side = 0; side < Chunk<scene>::sides; ++side) {
    typename I::Real fields[8];
    chunk.template take_fields<I>(at, side, fields);
    for (int field = 0; field < 7; ++field) fields[field] = rounded<I>(fields[field], c.force);
    I::to_records(fields, records[side]);
  }
  for (int lane = 0; lane < I::width; ++lane) {
    const std::int32_t i = b.i[k + lane];
    double* own = b.sum + record_size * static_cast<std::int64_t>(i - b.first);
    // Of a new owner the sum so far is loaded. Of the old one it must not be, even in vain: it would wait for the last
    // store to the same place.
    const bool again = i == owner;
    const auto place = reinterpret_cast<std::uintptr_t>(own), none = reinterpret_cast<std::uintptr_t>(nothing);
    const auto* so_far = reinterpret_cast<const double*>(place ^ ((place ^ none) & (std::uintptr_t{0} - again)));
    carried = I::add(I::select(again, carried, I::load_record(so_far)), records[0][lane]);
    owner = i;
    I::store_record(own, carried);
    double* slot = b.sum + record_size * static_cast<std::int64_t>(b.slot_j[k + lane]);
    I::store_record(slot, I::add_reaction(I::load_record(slot), records[Chunk<scene>::sides - 1][lane]));
  }
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

// The vectors of a chunk in which something is to be found: where a pair touches, touched at the last step, or has a
// history to forget. In a bed these are all, in a rain hardly any.
struct ActiveVectors {
  int at[chunk_size];
  int count = 0;
};
template <class I, SceneTraits scene>
PLATEN_INLINE ActiveVectors active_vectors(const Chunk<scene>& chunk, const PairBatch& b, double dt, std::int32_t start, int count) {
  using Real = typename I::Real;
  const Real zero = I::set(0.0);
  ActiveVectors active;
  for (int at = 0; at < count; at += I::width) {
    const Real delta = I::load(chunk.delta + at), before = I::fma(I::load(chunk.v_n + at), I::set(dt), delta);
    bool some = I::any(I::either(delta > zero, before > zero));
    if (!some) {
      const std::int32_t k = start + at;
      Real size = (I::abs(I::load(b.tx + k)) + I::abs(I::load(b.ty + k))) + I::abs(I::load(b.tz + k));
      if constexpr (scene.plasticity) size = size + I::abs(I::load(b.sp + k));
      if constexpr (scene.exponent != Exponent::one) size = size + I::abs(I::load(b.k_t_last + k));
      some = I::any(I::negate(zero >= size));
    }
    active.at[active.count] = at;
    active.count += some;
  }
  return active;
}

// What a chunk shows of forces that are no forces. Tests of sums cost less than those of every contact; where a sum is
// too large or not a number, `too_strong` looks at each.
template <class I>
struct Guards {
  typename I::Real strength = I::set(0.0);        // sum of |Fx| + |Fy| + |Fz| + S, which is more than the root of |F|^2 + S^2 of any
  typename I::Real lever_i = I::set(1.0), lever_j = I::set(1.0);  // the shortest
};

// Whether a contact of the chunk is out of its bound [N]. Written so that a NaN counts as too strong.
template <class I, SceneTraits scene>
bool too_strong(const Chunk<scene>& chunk, const ActiveVectors& active, double bound) {
  bool strong = false;
  for (int m = 0; m < active.count; ++m) {
    const Vec3<I> F = Chunk<scene>::template take<I>(chunk.F, active.at[m]);
    typename I::Real strength2 = dot(F, F);
    if constexpr (scene.rolling == Rolling::absolute) {
      const typename I::Real S = I::load(chunk.S[0] + active.at[m]);
      strength2 = I::fma(S, S, strength2);
    }
    strong = strong || I::any(I::negate(strength2 < I::set(bound * bound)));
  }
  return strong;
}

// Law of a chunk; whether every contribution is a number within its bound. (Only benches leave the guards out, to see
// what they cost.)
template <class I, SceneTraits scene, bool exact, bool guarded>
PLATEN_INLINE bool law_of_chunk(Chunk<scene>& chunk, const PairBatch& b, const LawConstants& c, std::int32_t start,
                                const ActiveVectors& active, PairTotals& totals) {
  using Real = typename I::Real;
  const Real zero = I::set(0.0);
  PairEnergies<I> sums = {zero, zero, zero, zero, zero};
  Guards<I> guards;
  int contacts = 0;
  for (int m = 0; m < active.count; ++m) {
    const int at = active.at[m];
    const Pairs<I> pairs = chunk.template take_pairs<I>(at);
    PairEnergies<I> energy;
    const PairForces<I> forces = pair_forces<I, scene, exact>(pairs, b, c, start + at, energy);
    chunk.template put_forces<I>(at, forces);
    contacts += I::count(forces.touching);
    if constexpr (guarded) {
      guards.strength = guards.strength + ((I::abs(forces.F.x) + I::abs(forces.F.y)) + (I::abs(forces.F.z) + forces.S_i));
      // Pairs that are apart have levers above 1, and padding, whose lever is no number, gives the second operand.
      guards.lever_i = I::min(pairs.lever_i, guards.lever_i);
      if constexpr (!scene.equal_spheres) guards.lever_j = I::min(pairs.lever_j, guards.lever_j);
    }
    if constexpr (scene.energy) {
      sums.viscous = sums.viscous + rounded<I>(energy.viscous, c.energy);
      sums.sliding = sums.sliding + rounded<I>(energy.sliding, c.energy);
      if constexpr (scene.plasticity) sums.plastic = sums.plastic + rounded<I>(energy.plastic, c.energy);
      if constexpr (scene.rolling == Rolling::relative) sums.rolling = sums.rolling + rounded<I>(energy.rolling, c.energy);
      if constexpr (scene.exponent != Exponent::one) sums.model = sums.model + rounded<I>(energy.model, c.energy);
    }
  }
  bool fine = true;
  if constexpr (guarded) {
    // An overlap above R, the centre of one sphere deep inside the other, is no contact any more: a lever below R/2.
    auto deep = guards.lever_i < I::set(0.5);
    if constexpr (!scene.equal_spheres) deep = I::either(deep, guards.lever_j < I::set(0.5));
    if (I::any(I::either(deep, I::negate(guards.strength < I::set(c.force.bound))))) fine = !I::any(deep) && !too_strong<I, scene>(chunk, active, c.force.bound);
  }
  if constexpr (scene.energy) {
    double size = 0.0;
    for_each_energy<I, scene>(sums, [&](int term, const Real& sum) {
      const double total = I::sum(sum);
      if constexpr (guarded) size += total < 0.0 ? -total : total;
      totals.energy[term] += static_cast<std::int64_t>(total * c.energy.inverse);
    });
    // Beyond this bound sums are not exact. With forces within theirs a contact would have to move radii in one step, so
    // that this is met by numbers that are none.
    if constexpr (guarded) fine = fine && size < chunk_size / 2 * c.energy.bound;
  }
  totals.contacts += contacts;
  return fine;
}

// Three loops over each chunk instead of one with everything in it: a processor looks a few hundred instructions ahead,
// so only short bodies let the next contacts begin while the last ones wait for their results.
template <class I, SceneTraits scene, bool exact, bool guarded = true>
void contact_kernel(const PairBatch& batch, const LawConstants& constants, PairTotals& totals) noexcept {
  const PairBatch b = batch;  // copies, which no store through a pointer can change
  const LawConstants c = constants;
  typename I::Record carried = I::zero_record();
  std::int32_t owner = -1;
  bool fine = true;
  Chunk<scene> chunk;
  alignas(64) const double nothing[record_size] = {};
  for (std::int32_t start = 0; start < b.count; start += chunk_size) {
    const int count = start + chunk_size < b.count ? chunk_size : b.count - start;
    if (c.width > 0.0)
      for (int at = 0; at < count; at += I::width)
        chunk.template put_pairs<I>(at, fetch_pairs<I, scene, exact, true>(b, c, start + at));
    else
      for (int at = 0; at < count; at += I::width)
        chunk.template put_pairs<I>(at, fetch_pairs<I, scene, exact, false>(b, c, start + at));
    using Wide = typename Interleaved<I>::Type;
    const ActiveVectors active = active_vectors<Wide, scene>(chunk, b, c.dt, start, count);
    fine = law_of_chunk<Wide, scene, exact, guarded>(chunk, b, c, start, active, totals) && fine;
    for (int m = 0; m < active.count; ++m)
      for (int at = active.at[m]; at < active.at[m] + Wide::width; at += I::width)
        output_pairs<I, scene>(chunk, at, b, c, start + at, nothing, carried, owner);
  }
  totals.out_of_range = totals.out_of_range || !fine;
}

}  // namespace platen
