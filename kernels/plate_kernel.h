// One pass over the spheres of a batch that may touch one plane: fetch -> law -> output. Plates are far stiffer than
// pairs, so their forces are not rounded: motion adds them to the finished sum of a particle in the order of planes.
#pragma once

#include "kernels/hertz_mindlin.h"

namespace platen {

template <class I, bool exact>
void plate_kernel(const PlateBatch& b, const Plane& plane, const PlateConstants& c, PlateTotals& totals) noexcept {
  using Real = typename I::Real;
  const Real zero = I::set(0.0), sign = I::set(plane.sign), dt = I::set(c.dt);
  const Real force_bound2 = I::set(c.force.bound * c.force.bound), energy_bound = I::set(c.energy.bound);
  Real along[3] = {zero, zero, zero};
  along[plane.axis] = sign;
  const Vec3<I> n = {along[0], along[1], along[2]};
  double lane_number[I::width];
  for (int lane = 0; lane < I::width; ++lane) lane_number[lane] = lane;
  const Real lanes = I::load(lane_number);
  const auto energy_units = [&](Real e) {
    const Real magic = I::set(c.energy.magic);
    return static_cast<std::int64_t>(I::sum((e + magic) - magic) * c.energy.inverse);
  };

  for (std::int32_t k = 0; k < b.count; k += I::width) {
    Real row[12];
    I::template fetch_rows<row_size>(b.rows, b.particle + k, row);
    const Real *x = row, *v = row + 4, *u = row + 8;
    const Real R = x[3], m = v[3], inverse_R = u[3];
    const Real distance = sign * (x[plane.axis] - I::set(plane.position));
    const auto touching = I::both(R - distance > zero, lanes + I::set(k) < I::set(b.used));
    const Real delta = I::where(touching, R - distance, zero);
    const Real lever = I::set(1.0) - delta * inverse_R;
    Real moving[3] = {v[0], v[1], v[2]};
    moving[plane.axis] = moving[plane.axis] - I::set(plane.velocity);
    const Vec3<I> against = {moving[0], moving[1], moving[2]};
    const Vec3<I> slip = against + cross(n, scale<I>(lever, Vec3<I>{u[0], u[1], u[2]}));
    const Real v_n = dot(slip, n);
    const Vec3<I> v_t = add_scaled<I>(slip, -v_n, n);

    const Vec3<I> xi_old = {I::load(b.xi_x + k), I::load(b.xi_y + k), I::load(b.xi_z + k)};
    const Real S_last = I::load(b.stiffness_last + k);
    const PlateResponse<I> r = plate_response<I, exact>(delta, R, m, v_n, v_t, xi_old, c);
    const Vec3<I> none = {zero, zero, zero};
    const Vec3<I> xi = where<I>(touching, r.xi, none);
    I::store(b.xi_x + k, xi.x), I::store(b.xi_y + k, xi.y), I::store(b.xi_z + k, xi.z);
    I::store(b.stiffness_last + k, I::where(touching, r.stiffness_t, zero));
    I::store(b.overlap + k, I::where(touching, delta, zero));

    const Vec3<I> F = where<I>(touching, add_scaled<I>(r.tangential_force, r.normal_force, n), none);
    const Vec3<I> T = where<I>(touching, scale<I>(-lever, cross(n, r.tangential_force)), none);
    const Real P = I::where(touching, I::set(c.mu_r) * r.spring_force * lever, zero);
    const Real fields[8] = {F.x, F.y, F.z, zero, T.x, T.y, T.z, P};
    typename I::Record records[I::width];
    I::to_records(fields, records);
    for (int lane = 0; lane < I::width; ++lane)
      I::store_record(b.records + record_size * static_cast<std::int64_t>(k + lane), records[lane]);

    const Real half = I::set(0.5), old2 = dot(xi_old, xi_old);
    // As in law_phase.h: v(n-1/2)^2 (3/4 c(n) + 1/4 c(n-1)) dt, c^2 = damping m S.
    const Real c_t_last = I::sqrt((I::set(c.damping) * m) * S_last);
    const Real c_n_last = c_t_last * I::set(c.normal_to_tangential);
    const Real now = I::set(0.75 * c.dt), before = I::set(0.25 * c.dt);
    const Real c_n = I::where(touching, r.c_n * now, zero) + c_n_last * before;
    const Real c_t = I::where(touching, r.c_t * now, zero) + I::where(r.c_t > zero, c_t_last, zero) * before;
    const Real viscous = I::where(I::either(touching, S_last > zero), c_n * (v_n * v_n) + c_t * dot(v_t, v_t), zero);
    // Work of the mean of the old and the new spring force over the slip; and what the change of S_t does to the stored
    // energy beyond the work of that mean force, which is no work of anything [A17].
    const Real sliding = I::where(touching, half * I::fma(S_last, r.slip_old, r.stiffness_t * r.slip_new), half * S_last * old2);
    const Real model = I::where(touching, half * dot(xi_old, xi) * (r.stiffness_t - S_last), zero);
    const Real on_axis[3] = {F.x, F.y, F.z};
    const Real work = on_axis[plane.axis] * I::set(plane.velocity) * dt;
    totals.energy[term_viscous] += energy_units(viscous);
    totals.energy[term_sliding] += energy_units(sliding);
    totals.energy[term_model] += energy_units(model);
    totals.work += energy_units(work);
    const Real size = ((I::abs(viscous) + I::abs(sliding)) + I::abs(model)) + I::abs(work);
    // A lever below 0 is an overlap above R: the centre is beyond the plane.
    const auto fine = I::both(I::both(dot(F, F) < force_bound2, size < energy_bound), lever >= zero);
    totals.out_of_range = totals.out_of_range || I::any(I::negate(fine));
  }
}

}  // namespace platen
