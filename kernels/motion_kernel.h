// Kick, rolling friction, drift and wrap of a batch's particles; writes their rows [docs/laws.md, "Integration"].
//
//   v(n+1/2) = v(n-1/2) + (F/m - g e_z) (dt_old + dt_new)/2          x(n+1) = x(n) + v(n+1/2) dt_new
//   u(n+1/2) = u(n-1/2) + (5/2) T/m (dt_old + dt_new)/2, then slowed by rolling friction
#pragma once

#include "kernels/rolling.h"
#include "kernels/rows.h"
#include "kernels/views.h"

namespace platen {

// Asks for all that a vector of spheres some vectors on has: twenty streams and more, in which a processor foresees less than there is time for.
// Not behind the batch's last, where another thread may be at work.
template <class I, bool equal_spheres>
PLATEN_INLINE void ask_for_spheres(const MotionBatch& b, std::int64_t k) {
  constexpr std::int64_t line = 8;
  for (std::int64_t lane = 0; lane < I::width; ++lane) __builtin_prefetch(b.sum + record_size * (k + lane), 1);
  for (std::int64_t m = 0; m < row_size * I::width; m += line) __builtin_prefetch(b.rows + row_size * k + m, 1);
  if (b.x != nullptr)
    for (const double* column : {b.x, b.y, b.z, b.vx, b.vy, b.vz, b.ux, b.uy, b.uz}) __builtin_prefetch(column + k, 1);
  __builtin_prefetch(b.speed2 + k, 1);
  if constexpr (!equal_spheres)
    for (const double* column : {b.inverse_mass, b.mass, b.radius, b.inverse_radius}) __builtin_prefetch(column + k);
}

template <class I, bool equal_spheres, bool rolling, bool energy, bool guarded = true>
void motion_kernel(const MotionBatch& b, const MotionConstants& c, MotionTotals& totals) noexcept {
  using Real = typename I::Real;
  const Real zero = I::set(0.0), kick = I::set(c.kick), drift = I::set(c.drift);
  Real fastest = zero;    // speed, squared
  Real rolled = zero;
  Real strongest = zero;  // largest force on a sphere, squared
  const bool in_rows = b.x == nullptr;
  for (std::int32_t k = 0; k < b.count; k += I::width) {
    if (I::width > 1 && b.asks && k + 4 * I::width < b.count) ask_for_spheres<I, equal_spheres>(b, k + 4 * I::width);
    typename I::Record records[I::width];
    for (int lane = 0; lane < I::width; ++lane)
      records[lane] = I::load_record(b.sum + record_size * static_cast<std::int64_t>(k + lane));
    Real f[8];
    I::from_records(records, f);
    bool clears = b.clears;
    if constexpr (guarded) {
      const Real push2 = I::fma(f[2], f[2], I::fma(f[1], f[1], f[0] * f[0]));
      strongest = I::max(strongest, push2);
      clears = clears && !I::any(I::not_less(push2, I::set(c.strongest2)));
    }
    // While they are here, instead of by a pass of its own.
    if (clears)
      for (int lane = 0; lane < I::width; ++lane) I::store_record(b.sum + record_size * static_cast<std::int64_t>(k + lane), I::zero_record());
    Real inverse_m, m, R, inverse_R;
    if constexpr (equal_spheres) {
      inverse_m = I::set(c.inverse_mass), m = I::set(c.mass), R = I::set(c.radius), inverse_R = I::set(c.inverse_radius);
    } else {
      inverse_m = I::load(b.inverse_mass + k), m = I::load(b.mass + k), R = I::load(b.radius + k);
      inverse_R = I::load(b.inverse_radius + k);
    }

    double* row = b.rows + row_size * static_cast<std::int64_t>(k);
    Vec3<I> x, v, u;
    if (in_rows) {
      const RowPart<I> places = fetch_next_rows<I>(row, 0), velocities = fetch_next_rows<I>(row, 1), spins = fetch_next_rows<I>(row, 2);
      x = {places.of[0], places.of[1], places.of[2]};
      v = {velocities.of[0], velocities.of[1], velocities.of[2]};
      u = {spins.of[0], spins.of[1], spins.of[2]};
    } else {
      x = {I::load(b.x + k), I::load(b.y + k), I::load(b.z + k)};
      v = {I::load(b.vx + k), I::load(b.vy + k), I::load(b.vz + k)};
      u = {I::load(b.ux + k), I::load(b.uy + k), I::load(b.uz + k)};
    }
    const Vec3<I> acceleration = {f[0] * inverse_m, f[1] * inverse_m, f[2] * inverse_m - I::set(c.gravity)};
    v = add_scaled<I>(v, kick, acceleration);

    const Vec3<I> u_before = u;
    const Real turn = (I::set(2.5) * inverse_m) * kick;
    u = add_scaled<I>(u, turn, Vec3<I>{f[4], f[5], f[6]});
    if constexpr (rolling) {
      const Real strength = I::set(c.mu_r) * f[3] + f[7];
      // Where nothing brakes no spin is changed by a bit, and a root and a division are spared.
      if (I::any(I::negate(zero >= strength))) {
        const Vec3<I> slowed = slowed_spin<I>(u, strength * turn);
        if constexpr (energy) {
          // Work of rolling friction: what it took off the spin, times the mean spin of the kick. The other torques do
          // theirs over the same spin. At rest, where it holds a torque and nothing turns, it takes nothing.
          const Real lost = (I::set(0.2) * m) * dot(u - slowed, u_before + slowed);
          const Real magic = I::set(c.energy.magic);
          rolled = rolled + ((lost + magic) - magic);
        }
        u = slowed;
      }
    }

    x = add_scaled<I>(x, drift, v);
    const auto wrap = [&](Real& coordinate, double length, int axis) {
      const Real L = I::set(length);
      const auto below = coordinate < zero, above = coordinate >= L;
      if (!I::any(I::either(below, above))) return;
      double shift[I::width];
      I::store(shift, I::where(below, I::set(-1.0), I::where(above, I::set(1.0), zero)));
      for (int lane = 0; lane < I::width; ++lane)
        b.crossed[2 * (k + lane) + axis] = static_cast<std::int8_t>(b.crossed[2 * (k + lane) + axis] + static_cast<int>(shift[lane]));
      coordinate = I::where(below, coordinate + L, I::where(above, coordinate - L, coordinate));
    };
    if (c.width > 0.0) wrap(x.x, c.width, 0), wrap(x.y, c.depth, 1);

    if (!in_rows) {
      I::store(b.vx + k, v.x), I::store(b.vy + k, v.y), I::store(b.vz + k, v.z);
      I::store(b.ux + k, u.x), I::store(b.uy + k, u.y), I::store(b.uz + k, u.z);
      I::store(b.x + k, x.x), I::store(b.y + k, x.y), I::store(b.z + k, x.z);
    }
    I::scatter4(row, 0, {x.x, x.y, x.z, R});
    I::scatter4(row, 4, {v.x, v.y, v.z, m});
    I::scatter4(row, 8, {u.x, u.y, u.z, inverse_R});

    const Vec3<I> excess = {v.x - I::set(c.mean_x), v.y - I::set(c.mean_y), v.z - I::set(c.mean_z)};
    const Real speed2 = dot(excess, excess);
    I::store_floats(b.speed2 + k, I::load_floats(b.speed2 + k) + speed2);
    fastest = I::max(fastest, speed2);
  }
  totals.fastest2 = I::largest(fastest);
  if constexpr (guarded) totals.strongest = I::largest(strongest);
  if constexpr (energy && rolling) {
    const double total = I::sum(rolled);
    // Beyond this bound the sum is not exact.
    if constexpr (guarded) totals.out_of_range = totals.out_of_range || !(total < chunk_size / 2 * c.energy.bound && total > -(chunk_size / 2 * c.energy.bound));
    totals.rolling += static_cast<std::int64_t>(total * c.energy.inverse);
  }
}

}  // namespace platen
