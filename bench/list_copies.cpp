#include "bench/list_copies.h"

#include <algorithm>
#include <limits>

namespace platen::bench {

StateCopy::StateCopy(const Particles& p)
    : x(copy_of(p.x)),
      y(copy_of(p.y)),
      z(copy_of(p.z)),
      vx(copy_of(p.vx)),
      vy(copy_of(p.vy)),
      vz(copy_of(p.vz)),
      ux(copy_of(p.ux)),
      uy(copy_of(p.uy)),
      uz(copy_of(p.uz)),
      inverse_mass(copy_of(p.inverse_mass)),
      mass(copy_of(p.mass)),
      radius(copy_of(p.radius)),
      inverse_radius(copy_of(p.inverse_radius)),
      rows(copy_of(p.rows)),
      crossed(copy_of(p.crossed)) {}

PlateBatch PlateCopy::view(const StateCopy& state) {
  return {state.rows.data(),     particle.data(), xi_x.data(),    xi_y.data(), xi_z.data(),
          stiffness_last.data(), records.data(),  overlap.data(), padded,      used};
}

BatchCopy::BatchCopy(const Batch& b)
    : row_j(copy_of(b.row_j)),
      targets(copy_of(b.to)),
      owners(copy_of(b.owners_of_eight)),
      sp(copy_of(b.sp)),
      tx(copy_of(b.tx)),
      ty(copy_of(b.ty)),
      tz(copy_of(b.tz)),
      k_t_last(copy_of(b.k_t_last)),
      sum(copy_of(b.sum)),
      speed2(static_cast<std::size_t>(b.count), 0.0f),
      first(b.first),
      count(b.count),
      used(b.used),
      padded(b.padded),
      halo(b.halo),
      incoming(b.incoming) {
  for (int plate = 0; plate < plate_count; ++plate) {
    const PlateList& from = b.plates[plate];
    if (from.used == 0) continue;
    PlateCopy to;
    to.plate = plate;
    to.particle = copy_of(from.particle);
    to.xi_x = copy_of(from.xi_x), to.xi_y = copy_of(from.xi_y), to.xi_z = copy_of(from.xi_z);
    to.stiffness_last = copy_of(from.stiffness_last);
    to.records = copy_of(from.records), to.overlap = copy_of(from.overlap);
    to.used = from.used, to.padded = from.padded;
    plates.push_back(std::move(to));
  }
}

PairBatch BatchCopy::pairs(const StateCopy& state) {
  PairBatch b{};
  b.rows = state.rows.data();
  b.own_rows = b.rows + row_size * static_cast<std::int64_t>(first);
  b.row_j = row_j.data(), b.to = targets.data(), b.owners = owners.data();
  b.sp = sp.data(), b.tx = tx.data(), b.ty = ty.data(), b.tz = tz.data();
  b.k_t_last = k_t_last.empty() ? nullptr : k_t_last.data();
  b.sum = sum.data();
  b.first = first, b.count = padded, b.end = first + count;
  b.nothing = static_cast<std::int32_t>(sum.size() * sizeof(double)) - record_bytes;
  b.dense = true;
  b.leap = std::numeric_limits<double>::infinity();  // every listed pair goes through the law
  const auto column = [&](const AlignedArray<double>& a) { return a.data() + first; };
  b.x = column(state.x), b.y = column(state.y), b.z = column(state.z);
  b.vx = column(state.vx), b.vy = column(state.vy), b.vz = column(state.vz);
  b.ux = column(state.ux), b.uy = column(state.uy), b.uz = column(state.uz);
  return b;
}

MotionBatch BatchCopy::motion(StateCopy& s, bool clears) {
  const auto at = static_cast<std::size_t>(first);
  const auto column = [&](AlignedArray<double>& a) { return a.empty() ? nullptr : a.data() + at; };
  return {column(s.x),
          column(s.y),
          column(s.z),
          column(s.vx),
          column(s.vy),
          column(s.vz),
          column(s.ux),
          column(s.uy),
          column(s.uz),
          column(s.inverse_mass),
          column(s.mass),
          column(s.radius),
          column(s.inverse_radius),
          s.rows.data() + row_size * at,
          s.crossed.data() + 2 * at,
          sum.data(),
          clears,
          speed2.data(),
          count,
          false};
}

std::int64_t BatchCopy::list_bytes() const {
  const std::int64_t history = k_t_last.empty() ? 4 : 5;
  const auto pair = static_cast<std::int64_t>(sizeof(std::int32_t) + sizeof(PairTargets)) + 2 * history * static_cast<std::int64_t>(sizeof(double));
  return padded * pair + padded / 8 * static_cast<std::int64_t>(sizeof(OwnersOfEight));
}

std::int64_t BatchCopy::row_bytes() const {
  std::vector<std::int32_t> spheres;
  for (const PairTargets& to : targets) spheres.push_back(row_size * (first + owner_of(to)));
  spheres.insert(spheres.end(), row_j.begin(), row_j.end());
  std::sort(spheres.begin(), spheres.end());
  const auto distinct = std::unique(spheres.begin(), spheres.end()) - spheres.begin();
  return distinct * static_cast<std::int64_t>(row_size * sizeof(double));
}

std::int64_t BatchCopy::sum_bytes() const {
  return static_cast<std::int64_t>(2 * sum.size() * sizeof(double));  // read and written
}

std::vector<BatchCopy> copies_of(const Simulation& sim) {
  std::vector<BatchCopy> all;
  for (const Batch& b : sim.batches()) all.emplace_back(b);
  return all;
}

MotionConstants motion_constants(const Simulation& sim, const PairLaw& law, double gravity) {
  const Particles& p = sim.state();
  MotionConstants c{};
  c.kick = c.drift = sim.time_step();
  c.gravity = gravity;
  c.mu_r = law.rolling_model == RollingModel::absolute ? law.rolling_friction : 0.0;
  c.mass = p.common_mass, c.inverse_mass = 1.0 / p.common_mass;
  c.radius = p.common_radius, c.inverse_radius = 1.0 / p.common_radius;
  c.width = sim.law().width, c.depth = sim.law().depth;
  c.energy = sim.law().energy;
  c.strongest2 = std::numeric_limits<double>::infinity();
  return c;
}

}  // namespace platen::bench
