#include "bench/scalar_loops.h"

#include <cmath>

namespace platen::bench {

std::int64_t scalar_forces(const ScalarBed& bed, const ScalarConstants& c, double dt, ScalarLedger& ledger) {
  const double reach = 2.0 * c.R, reach2 = reach * reach, inverse_R = 1.0 / c.R;
  const double half_width = 0.5 * c.width, half_depth = 0.5 * c.depth;
  const double half_over_k_t = 0.5 / c.k_t;
  double plastic = 0.0, viscous = 0.0, sliding = 0.0;
  std::int64_t touching = 0;
  for (std::int32_t i = 0; i < bed.count; ++i) bed.sums[i] = ScalarSum{};
  for (std::int32_t i = 0; i < bed.count; ++i) {
    const ScalarSphere a = bed.spheres[i];
    ScalarSum sum = bed.sums[i];
    for (std::int32_t k = bed.start[i]; k < bed.start[i + 1]; ++k) {
      const std::int32_t j = bed.partner[k];
      const ScalarSphere& b = bed.spheres[j];
      ScalarHistory& h = bed.history[k];
      double dx = a.x[0] - b.x[0], dy = a.x[1] - b.x[1];
      const double dz = a.x[2] - b.x[2];
      if (dx > half_width)
        dx -= c.width;
      else if (dx < -half_width)
        dx += c.width;
      if (dy > half_depth)
        dy -= c.depth;
      else if (dy < -half_depth)
        dy += c.depth;
      const double distance2 = dx * dx + dy * dy + dz * dz;
      if (distance2 >= reach2) {
        if (h.sp != 0.0 || h.T[0] != 0.0 || h.T[1] != 0.0 || h.T[2] != 0.0) {  // parted in this step: history ends
          const double inverse = 1.0 / std::sqrt(distance2);
          const double v_n = ((a.v[0] - b.v[0]) * dx + (a.v[1] - b.v[1]) * dy + (a.v[2] - b.v[2]) * dz) * inverse;
          viscous += 0.25 * dt * c.beta_n * v_n * v_n;
          plastic -= c.plastic_adhesive * h.sp * h.sp;
          sliding += half_over_k_t * (h.T[0] * h.T[0] + h.T[1] * h.T[1] + h.T[2] * h.T[2]);
          h = ScalarHistory{};
        }
        continue;
      }
      ++touching;
      const double distance = std::sqrt(distance2), inverse = 1.0 / distance;
      const double nx = dx * inverse, ny = dy * inverse, nz = dz * inverse;
      const double delta = reach - distance;
      const double lever = 1.0 - 0.5 * delta * inverse_R;

      const double wx = lever * (a.u[0] + b.u[0]), wy = lever * (a.u[1] + b.u[1]), wz = lever * (a.u[2] + b.u[2]);
      const double vx = a.v[0] - b.v[0], vy = a.v[1] - b.v[1], vz = a.v[2] - b.v[2];
      const double v_n = vx * nx + vy * ny + vz * nz;
      const double ax = vx - v_n * nx, ay = vy - v_n * ny, az = vz - v_n * nz;
      const double lag = 0.5 * dt * inverse * (wx * nx + wy * ny + wz * nz);
      const double qx = wx + lag * ax, qy = wy + lag * ay, qz = wz + lag * az;
      const double tx = ax + (ny * qz - nz * qy);
      const double ty = ay + (nz * qx - nx * qz);
      const double tz = az + (nx * qy - ny * qx);

      // normal [Eq. 2]
      const double sp_old = h.sp;
      double sp = sp_old;
      if (sp < c.sp_lower * delta) sp = c.sp_lower * delta;
      if (sp > c.sp_upper * delta) sp = c.sp_upper * delta;
      const double elastic = c.k2 * (delta - sp), f_hys = elastic + c.f0;
      const double f_n = f_hys - c.beta_n * v_n;

      // tangential [Eq. 5-10]
      const double T2 = h.T[0] * h.T[0] + h.T[1] * h.T[1] + h.T[2] * h.T[2];
      const double along = h.T[0] * nx + h.T[1] * ny + h.T[2] * nz;
      double sx = h.T[0] - along * nx, sy = h.T[1] - along * ny, sz = h.T[2] - along * nz;
      const double flat2 = sx * sx + sy * sy + sz * sz;
      if (flat2 > 0.0) {
        const double stretch = std::sqrt(T2 / flat2);
        sx *= stretch, sy *= stretch, sz *= stretch;
      }
      const double ox = sx, oy = sy, oz = sz, step = c.k_t * dt;
      sx -= step * tx, sy -= step * ty, sz -= step * tz;
      const double trial2 = sx * sx + sy * sy + sz * sz;
      const double limit = c.mu * std::fabs(elastic + c.k_adh * delta);
      const double share = v_n * dt + delta > 0.0 ? dt : 0.75 * dt;
      double Fx = sx, Fy = sy, Fz = sz;
      viscous += c.beta_n * share * v_n * v_n;
      if (trial2 >= limit * limit) {
        const double back = trial2 > 0.0 ? limit / std::sqrt(trial2) : 0.0;
        sliding += half_over_k_t * (1.0 - back) * (back * trial2 + (ox * sx + oy * sy + oz * sz));
        sx *= back, sy *= back, sz *= back;
        Fx = sx, Fy = sy, Fz = sz;
      } else {
        Fx -= c.beta_t * tx, Fy -= c.beta_t * ty, Fz -= c.beta_t * tz;
        viscous += c.beta_t * share * (tx * tx + ty * ty + tz * tz);
      }
      plastic += (sp > sp_old ? c.plastic_loading : c.plastic_adhesive) * (sp - sp_old) * (sp + sp_old);
      h.sp = sp, h.T[0] = sx, h.T[1] = sy, h.T[2] = sz;

      const double gx = Fx + f_n * nx, gy = Fy + f_n * ny, gz = Fz + f_n * nz;
      const double mx = -lever * (ny * Fz - nz * Fy), my = -lever * (nz * Fx - nx * Fz),
                   mz = -lever * (nx * Fy - ny * Fx);
      const double strength = std::fabs(f_hys) * lever;
      sum.F[0] += gx, sum.F[1] += gy, sum.F[2] += gz;
      sum.T[0] += mx, sum.T[1] += my, sum.T[2] += mz;
      sum.S += strength;
      ScalarSum& other = bed.sums[j];
      other.F[0] -= gx, other.F[1] -= gy, other.F[2] -= gz;
      other.T[0] += mx, other.T[1] += my, other.T[2] += mz;
      other.S += strength;
    }
    bed.sums[i] = sum;
  }
  ledger.plastic += plastic, ledger.viscous += viscous, ledger.sliding += sliding;
  return touching;
}

void scalar_plate_forces(const ScalarBed& bed, const ScalarConstants& c, const ScalarPlate& plate, double dt,
                         double* rolling_strength, ScalarLedger& ledger) {
  for (std::int32_t k = 0; k < plate.count; ++k) {
    ScalarPlateContact& contact = plate.contacts[k];
    const ScalarSphere& s = bed.spheres[contact.sphere];
    const double n = plate.sign, delta = c.R - n * (s.x[2] - plate.position);
    const double S_last = contact.stiffness_last, c_t_last = std::sqrt(c.plate_damping * c.m * S_last);
    const double c_n_last = c_t_last * std::sqrt(c.S_n / c.S_t);
    const double v_n = n * (s.v[2] - plate.velocity);
    const double old2 = contact.xi[0] * contact.xi[0] + contact.xi[1] * contact.xi[1];
    if (delta <= 0.0) {
      ledger.viscous += 0.25 * dt * c_n_last * v_n * v_n;
      ledger.sliding += 0.5 * S_last * old2;
      contact.xi[0] = contact.xi[1] = contact.xi[2] = contact.stiffness_last = 0.0;
      continue;
    }
    const double lever = 1.0 - delta / c.R;
    const double tx = s.v[0] - n * lever * s.u[1], ty = s.v[1] + n * lever * s.u[0];
    const double root = std::sqrt(c.R * delta), F_s = c.hertz * root * delta;
    const double S_n = c.S_n * root, S_t = c.S_t * root;
    const double c_n = std::sqrt(c.plate_damping * c.m * S_n);
    double c_t = std::sqrt(c.plate_damping * c.m * S_t), c_t_before = c_t_last;
    const double trial_x = contact.xi[0] + dt * tx, trial_y = contact.xi[1] + dt * ty;
    const double trial2 = trial_x * trial_x + trial_y * trial_y, longest = c.slip_ratio * delta;
    double back = 1.0;
    if (trial2 >= longest * longest) {
      back = trial2 > 0.0 ? longest / std::sqrt(trial2) : 0.0;
      c_t = c_t_before = 0.0;
      const double slip_old = (1.0 - back) * (contact.xi[0] * trial_x + contact.xi[1] * trial_y);
      ledger.sliding += 0.5 * (S_last * slip_old + S_t * (1.0 - back) * back * trial2);
    }
    const double xi_x = back * trial_x, xi_y = back * trial_y;
    ledger.viscous +=
        (0.75 * c_n + 0.25 * c_n_last) * dt * v_n * v_n + (0.75 * c_t + 0.25 * c_t_before) * dt * (tx * tx + ty * ty);
    ledger.model += 0.5 * (contact.xi[0] * xi_x + contact.xi[1] * xi_y) * (S_t - S_last);
    contact.xi[0] = xi_x, contact.xi[1] = xi_y, contact.stiffness_last = S_t;
    const double Fx = -S_t * xi_x - c_t * tx, Fy = -S_t * xi_y - c_t * ty, Fz = n * (F_s - c_n * v_n);
    ScalarSum& sum = bed.sums[contact.sphere];
    sum.F[0] += Fx, sum.F[1] += Fy, sum.F[2] += Fz;
    sum.T[0] += n * lever * Fy, sum.T[1] -= n * lever * Fx;
    rolling_strength[contact.sphere] += c.plate_mu_r * F_s * lever;
    ledger.work += Fz * plate.velocity * dt;
  }
}

double scalar_motion(const ScalarBed& bed, const ScalarConstants& c, double kick, double drift,
                     const double* rolling_strength, ScalarLedger& ledger) {
  const double inverse_m = 1.0 / c.m, turn = 2.5 * inverse_m * kick;
  double largest = 0.0, rolling = 0.0;
  for (std::int32_t k = 0; k < bed.count; ++k) {
    ScalarSphere& s = bed.spheres[k];
    const ScalarSum& sum = bed.sums[k];
    s.v[0] += kick * sum.F[0] * inverse_m;
    s.v[1] += kick * sum.F[1] * inverse_m;
    s.v[2] += kick * (sum.F[2] * inverse_m - c.gravity);
    for (int axis = 0; axis < 3; ++axis) s.u[axis] += turn * sum.T[axis];
    const double u2 = s.u[0] * s.u[0] + s.u[1] * s.u[1] + s.u[2] * s.u[2], size = std::sqrt(u2);
    const double loss = (c.mu_r * sum.S + rolling_strength[k]) * turn;
    const double left = loss < size ? (size - loss) / size : 0.0;
    rolling += 0.2 * c.m * u2 * (1.0 - left * left);
    for (int axis = 0; axis < 3; ++axis) s.u[axis] *= left;
    for (int axis = 0; axis < 3; ++axis) s.x[axis] += drift * s.v[axis];
    if (s.x[0] < 0.0)
      s.x[0] += c.width;
    else if (s.x[0] >= c.width)
      s.x[0] -= c.width;
    if (s.x[1] < 0.0)
      s.x[1] += c.depth;
    else if (s.x[1] >= c.depth)
      s.x[1] -= c.depth;
    const double speed2 = s.v[0] * s.v[0] + s.v[1] * s.v[1] + s.v[2] * s.v[2];
    largest = speed2 > largest ? speed2 : largest;
  }
  ledger.rolling += rolling;
  return largest;
}

}  // namespace platen::bench
