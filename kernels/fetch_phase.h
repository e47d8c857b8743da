// First phase of the contact kernel: both spheres of each pair, its geometry and relative motion.
#pragma once

#include "kernels/chunk.h"

namespace platen {

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
// The owner side. Consecutive contacts share owners, and owners follow each other along the curve: eight contacts mostly
// have theirs within eight places, which one load and one permutation per field bring.
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
  // Velocities are half a step old, and so is the normal that spins act around. What that changes in the tangent plane comes
  // from the spin about n alone [docs/laws.md, "Pairs"].
  const Real lag = (I::set(0.5 * c.dt) * inverse) * dot(spin, p.n);
  p.v_t = sub_scaled<I>(v, p.v_n, p.n) + cross(p.n, add_scaled<I>(spin, lag, v));
  if constexpr (scene.rolling == Rolling::relative) p.w = scale<I>(inverse_R_i, u_i) - scale<I>(inverse_R_j, u_j);
  return p;
}

}  // namespace platen
