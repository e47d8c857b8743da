// What can be asked of a Simulation: measures, snapshots, the hash, the limits of the time step, and what went wrong.
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <tuple>
#include <string>

#include "core/float_mode.h"
#include "core/simulation_detail.h"

namespace platen {

namespace {

// A pair as files and energies want it, seen from its owner.
struct PairState {
  std::int32_t i, j;
  double n[3], distance, delta, R_i, R_j, m_eff;
};

PairState pair_state(const Particles& p, const Domain& domain, std::int32_t i, std::int32_t j) {
  const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
  PairState s{i, j, {}, 0, 0, p.radius_of(i), p.radius_of(j), 0};
  const double d[3] = {domain.nearest_x(p.x[a] - p.x[b]), domain.nearest_y(p.y[a] - p.y[b]), p.z[a] - p.z[b]};
  s.distance = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  for (int axis = 0; axis < 3; ++axis) s.n[axis] = d[axis] / s.distance;
  s.delta = (s.R_i + s.R_j) - s.distance;
  const double mi = p.mass_of(i), mj = p.mass_of(j);
  s.m_eff = mi * mj / (mi + mj);
  return s;
}

double loading_slope(const LawConstants& c, double delta) {
  return c.exponent == 1.0 ? c.k1 : c.exponent * c.k1 * std::pow(std::max(delta, c.overlap_floor), c.exponent - 1.0);
}

double overlap_power(const LawConstants& c, double delta) { return c.exponent == 1.0 ? delta : std::pow(delta, c.exponent); }
double overlap_root(const LawConstants& c, double s) { return c.exponent == 1.0 ? s : std::pow(s, 1.0 / c.exponent); }

// Stored energy of the normal spring without f0 [docs/laws.md, "Energy"].
double normal_energy(const LawConstants& c, double delta, double sp) {
  const double n = c.exponent, delta_p = overlap_root(c, sp);
  if (n == 1.0) return 0.5 * c.k2 * (delta - delta_p) * (delta - delta_p);
  return c.k2 * ((std::pow(delta, n + 1.0) - std::pow(delta_p, n + 1.0)) / (n + 1.0) - sp * (delta - delta_p));
}

struct PairSums {
  FixedSum elastic, adhesion, tangential;
  double deepest = 0.0;  // overlap over diameter
  explicit PairSums(double unit) : elastic(unit), adhesion(unit), tangential(unit) {}
};

void add_pairs(const Batch& b, const Particles& p, const Domain& domain, const LawConstants& c, PairSums& sums) {
  for (std::size_t k = 0; k < static_cast<std::size_t>(b.used); ++k) {
    const PairState s = pair_state(p, domain, b.i(k), b.j(k));
    if (!(s.delta > 0.0)) continue;
    sums.deepest = std::max(sums.deepest, s.delta / (2.0 * std::min(s.R_i, s.R_j)));
    sums.elastic.add(normal_energy(c, s.delta, b.sp[k]));
    sums.adhesion.add(c.f0 * s.delta);
    const double k_t = c.ratio * loading_slope(c, s.delta);
    if (k_t > 0.0) sums.tangential.add((b.tx[k] * b.tx[k] + b.ty[k] * b.ty[k] + b.tz[k] * b.tz[k]) / (2.0 * k_t));
  }
}

}  // namespace

void add_plate_energy(const PlateList& list, const PlateConstants& c, FixedSum& sum, const Particles& p) {
  for (std::size_t k = 0; k < static_cast<std::size_t>(list.used); ++k) {
    const double delta = list.overlap[k];
    if (!(delta > 0.0)) continue;
    const double R = p.radius_of(list.particle[k]);
    const double xi2 = list.xi_x[k] * list.xi_x[k] + list.xi_y[k] * list.xi_y[k] + list.xi_z[k] * list.xi_z[k];
    // sqrt(R delta), not sqrt(R) sqrt(delta): a product that scales exactly under a similarity with powers of two.
    sum.add(0.4 * c.hertz * std::sqrt(R * delta) * delta * delta + 0.5 * list.stiffness_last[k] * xi2);
  }
}

void Simulation::add_pair_energy(FixedSum& sum) const {
  for (const Batch& b : batches_) {
    PairSums sums(energy_unit_);
    add_pairs(b, particles_, domain_, law_, sums);
    sum.add(sums.elastic), sum.add(sums.adhesion), sum.add(sums.tangential);
  }
}

double Simulation::stress(int plate) {
  const FloatMode mode;
  ensure_forces();
  if (area() <= 0.0) return 0.0;
  const Plane shape = plane_shape(plate);
  FixedSum force(plate_force_unit_);
  for (const Batch& b : batches_) {
    const PlateList& list = b.plates[plate];
    for (std::size_t k = 0; k < static_cast<std::size_t>(list.used); ++k)
      force.add(list.records[record_size * k + static_cast<std::size_t>(shape.axis)]);
  }
  return shape.sign * force.value() / area();
}

double Simulation::mean_radius() const {
  double sum = 0.0;
  for (const std::int32_t place : particles_.places()) sum += particles_.radius_of(place);
  return particles_.count > 0 ? sum / particles_.count : 0.0;
}

Measures Simulation::measure(bool stored_energies) {
  const FloatMode mode;
  ensure_forces();
  struct Part {
    FixedSum kinetic, rolled, potential, plate_energy, support, top, bottom, weight;
    double highest = -std::numeric_limits<double>::infinity(), farthest = 0.0;
    PairSums pairs;
    double fastest_turn = 0.0;           // [rad/s]
    bool touches = false, lost = false;  // lost: a position or velocity is not a number
    Part(double energy, double force)
        : kinetic(energy), rolled(energy), potential(energy), plate_energy(energy), support(force), top(force), bottom(force),
          weight(force), pairs(energy) {}
  };
  std::vector<Part> parts(batches_.size(), Part(energy_unit_, plate_force_unit_));
  const double half = 0.5 * last_drift_;
  const bool with_ledger = stored_energies && engine_.energy;
  parallel(static_cast<int>(batches_.size()), [&](int index) {
    Batch& b = batches_[static_cast<std::size_t>(index)];
    Part& part = parts[static_cast<std::size_t>(index)];
    if (!merged_[static_cast<std::size_t>(index)]) merge(b);
    merged_[static_cast<std::size_t>(index)] = 1;
    const Particles& p = particles_;
    for (std::int32_t local = 0; local < b.count && b.first + local < p.count; ++local) {
      const auto k = static_cast<std::size_t>(b.first + local);
      const double* s = b.sum.data() + record_size * static_cast<std::size_t>(local);
      const double m = p.mass_of(b.first + local), R = p.radius_of(b.first + local);
      const double h = half / m;
      const double v[3] = {p.vx[k] + h * s[0], p.vy[k] + h * s[1],
                           p.vz[k] + h * s[2] - half * gravity_};
      const double u[3] = {p.ux[k] + 2.5 * h * s[4], p.uy[k] + 2.5 * h * s[5],
                           p.uz[k] + 2.5 * h * s[6]};
      // Rolling friction up to the full time, as in motion_kernel.h.
      const double turning2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2], turning = std::sqrt(turning2);
      const double loss = 2.5 * h * (motion_.mu_r * s[3] + s[7]);
      const double left = loss < turning ? (turning - loss) / turning : 0.0;
      part.kinetic.add(0.5 * m * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + 0.2 * m * turning2 * left * left);
      const double before = p.ux[k] * u[0] + p.uy[k] * u[1] + p.uz[k] * u[2];  // u(n-1/2) . u
      part.rolled.add(0.2 * m * (1.0 - left) * (before + left * turning2));
      part.potential.add(m * gravity_ * p.z[k]);
      part.weight.add(m * gravity_);
      part.highest = std::max(part.highest, p.z[k] + R);
      part.farthest = std::max({part.farthest, std::fabs(p.x[k]), std::fabs(p.y[k]), std::fabs(p.z[k])});
      part.lost = part.lost || !std::isfinite(p.x[k] + p.y[k] + p.z[k] + v[0] + v[1] + v[2] + turning2);
      part.fastest_turn = std::max(part.fastest_turn, std::sqrt(p.ux[k] * p.ux[k] + p.uy[k] * p.uy[k] + p.uz[k] * p.uz[k]) / R);
    }
    if (stored_energies) add_pairs(b, p, domain_, law_, part.pairs);
    for (int plate = 0; plate < plate_count; ++plate) {
      const PlateList& list = b.plates[plate];
      if (with_ledger) add_plate_energy(list, plate_law_, part.plate_energy, p);
      for (std::size_t k = 0; k < static_cast<std::size_t>(list.used); ++k) {
        const double fz = list.records[record_size * k + 2];
        part.support.add(fz);
        if (plate == plate_top) part.top.add(-fz), part.touches = part.touches || list.overlap[k] > 0.0;
        if (plate == plate_bottom) part.bottom.add(fz);
      }
    }
  });
  Part all(energy_unit_, plate_force_unit_);
  for (const Part& part : parts) {
    all.kinetic.add(part.kinetic), all.rolled.add(part.rolled), all.potential.add(part.potential), all.plate_energy.add(part.plate_energy);
    all.support.add(part.support), all.top.add(part.top), all.bottom.add(part.bottom), all.weight.add(part.weight);
    all.pairs.elastic.add(part.pairs.elastic), all.pairs.adhesion.add(part.pairs.adhesion);
    all.pairs.tangential.add(part.pairs.tangential);
    all.highest = std::max(all.highest, part.highest);
    all.farthest = std::max(all.farthest, part.farthest);
    all.lost = all.lost || part.lost;
    all.fastest_turn = std::max(all.fastest_turn, part.fastest_turn);
    all.pairs.deepest = std::max(all.pairs.deepest, part.pairs.deepest);
    all.touches = all.touches || part.touches;
  }

  Measures r;
  r.step = step_, r.time = time();
  const bool bottom = plane(plate_bottom).present, top = plane(plate_top).present;
  const double z_bottom = bottom ? plane_position(plate_bottom) : 0.0;
  const double z_top = top ? plane_position(plate_top) : all.highest;
  r.highest_point = all.highest;
  r.farthest = all.lost ? std::numeric_limits<double>::quiet_NaN() : all.farthest;
  r.fastest_spin = all.fastest_turn;
  r.deepest_overlap = all.pairs.deepest;
  r.top_touches = all.touches;
  r.height = (top && (all.touches || z_top < all.highest) ? z_top : all.highest) - z_bottom;
  r.weight = all.weight.value();
  r.support_force = all.support.value();
  if (area() > 0.0) {
    r.stress_top = all.top.value() / area(), r.stress_bottom = all.bottom.value() / area();
    if (confined()) r.porosity = 1.0 - solid_volume_ / (area() * r.height);
  }
  r.contacts = contacts_;
  r.coordination_number = particles_.count > 0 ? 2.0 * static_cast<double>(contacts_) / particles_.count : 0.0;
  r.kinetic_energy = all.kinetic.value();
  const double potential = all.potential.value();  // from z = 0, for the ledger
  r.potential_energy = potential - r.weight * z_bottom;
  Ledger& l = r.ledger;
  if (with_ledger) {
    const auto joule = [this](Int128 quanta) { return static_cast<double>(quanta) / law_.energy.inverse; };
    l.elastic_energy = all.pairs.elastic.value(), l.adhesion_energy = all.pairs.adhesion.value();
    l.tangential_energy = all.pairs.tangential.value(), l.plate_energy = all.plate_energy.value();
    l.plastic_dissipation = joule(dissipated_[term_plastic]), l.viscous_dissipation = joule(dissipated_[term_viscous]);
    l.sliding_dissipation = joule(dissipated_[term_sliding]);
    l.rolling_dissipation = joule(dissipated_[term_rolling] + rolling_) + all.rolled.value();
    l.plate_model_work = joule(dissipated_[term_model]), l.plate_work = joule(plate_work_);
    l.inserted_energy = inserted_, l.removed_energy = removed_;
    r.energy_residual = r.kinetic_energy + potential + l.elastic_energy + l.adhesion_energy + l.tangential_energy +
                        l.plate_energy + l.dissipated() - l.plate_model_work - l.plate_work - l.inserted_energy +
                        l.removed_energy;
  }
  return r;
}

void Simulation::count_inserted() { inserted_ += measure().energy_residual; }

std::int64_t Simulation::carry_down(double z, double speed) {
  Particles& p = particles_;
  std::vector<std::size_t> carried;
  for (std::size_t k = 0; k < static_cast<std::size_t>(p.count); ++k)
    if (p.z[k] > z && p.vz[k] <= -speed && p.vx[k] == 0.0 && p.vy[k] == 0.0 && p.ux[k] == 0.0 && p.uy[k] == 0.0 && p.uz[k] == 0.0) carried.push_back(k);
  if (carried.empty()) return 0;
  const double before = measure(false).kinetic_energy;
  for (const std::size_t k : carried) p.vz[k] = p.rows[row_size * k + 6] = -speed;
  inserted_ += measure(false).kinetic_energy - before;
  return static_cast<std::int64_t>(carried.size());
}

Snapshot Simulation::snapshot(bool with_contacts) {
  const FloatMode mode;
  ChunkedArray<double> sums;
  ensure_forces();
  keep_sums(sums);
  Snapshot out;
  out.step = step_, out.time = time();
  const Particles& p = particles_;
  const auto n = static_cast<std::size_t>(p.count);
  ParticleFields& f = out.particles;
  const std::vector<std::int32_t> places = p.places();
  f.id = p.id_of_rank.all();
  f.position.resize(3 * n), f.velocity.resize(3 * n), f.angular_velocity.resize(3 * n), f.image.resize(2 * n);
  f.radius.resize(n), f.mass.resize(n);
  const double half = 0.5 * last_drift_;
  double highest = 0.0;
  for (std::size_t rank = 0; rank < n; ++rank) {
    const auto k = static_cast<std::size_t>(places[rank]);
    const double R = p.radius_of(places[rank]), m = p.mass_of(places[rank]);
    const double* s = &sums[record_size * rank];
    f.radius[rank] = R, f.mass[rank] = m;
    const double x[3] = {p.x[k], p.y[k], p.z[k]}, v[3] = {p.vx[k], p.vy[k], p.vz[k]}, u[3] = {p.ux[k], p.uy[k], p.uz[k]};
    double spin[3], size2 = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      f.position[3 * rank + axis] = x[axis];
      f.velocity[3 * rank + axis] = v[axis] + half * (s[axis] / m - (axis == 2 ? gravity_ : 0.0));
      spin[axis] = u[axis] + half * 2.5 * s[4 + axis] / m;
      size2 += spin[axis] * spin[axis];
    }
    const double loss = half * 2.5 * (motion_.mu_r * s[3] + s[7]) / m, size = std::sqrt(size2);
    const double left = loss < size ? (size - loss) / size : 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) f.angular_velocity[3 * rank + axis] = left * spin[axis] / R;
    f.image[2 * rank] = p.boxes(k, 0), f.image[2 * rank + 1] = p.boxes(k, 1);
    highest = rank == 0 ? p.z[k] + R : std::max(highest, p.z[k] + R);
  }
  out.z_bottom = plane(plate_bottom).present ? plane_position(plate_bottom) : 0.0;
  out.z_top = plane(plate_top).present ? std::min(plane_position(plate_top), highest) : highest;
  if (!with_contacts) return out;

  struct Row {
    std::int32_t low, high;
    const Batch* batch;
    std::size_t k;
  };
  std::vector<Row> rows;
  for (const Batch& b : batches_)
    for (std::size_t k = 0; k < static_cast<std::size_t>(b.used); ++k) {
      const std::int32_t ri = p.rank[static_cast<std::size_t>(b.i(k))], rj = p.rank[static_cast<std::size_t>(b.j(k))];
      if (pair_state(p, domain_, b.i(k), b.j(k)).delta > 0.0) rows.push_back({std::min(ri, rj), std::max(ri, rj), &b, k});
    }
  std::sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.low != b.low ? a.low < b.low : a.high < b.high; });
  ContactFields& c = out.contacts;
  for (const Row& row : rows) {
    const Batch& b = *row.batch;
    const std::size_t k = row.k;
    const bool straight = p.rank[static_cast<std::size_t>(b.i(k))] == row.low;
    const std::int32_t low = straight ? b.i(k) : b.j(k), high = straight ? b.j(k) : b.i(k);
    const double sign = straight ? 1.0 : -1.0;
    const PairState s = pair_state(p, domain_, low, high);
    const auto a = static_cast<std::size_t>(low), d = static_cast<std::size_t>(high);
    const double dx = p.x[a] - p.x[d], dy = p.y[a] - p.y[d];
    c.pair.push_back(p.id_of_rank[static_cast<std::size_t>(row.low)]);
    c.pair.push_back(p.id_of_rank[static_cast<std::size_t>(row.high)]);
    c.image.push_back(domain_.width > 0.0 ? static_cast<std::int32_t>(std::nearbyint(dx / domain_.width)) : 0);
    c.image.push_back(domain_.depth > 0.0 ? static_cast<std::int32_t>(std::nearbyint(dy / domain_.depth)) : 0);
    const double power = overlap_power(law_, s.delta), elastic = law_.k2 * (power - b.sp[k]);
    const double K1 = loading_slope(law_, s.delta), k_t = law_.ratio * K1;
    const double beta_n = std::sqrt(law_.damping * s.m_eff * K1), beta_t = beta_n * law_.beta_ratio;
    const double limit = law_.mu * std::fabs((elastic + law_.limit_f) + law_.limit_k * power);
    // Forces saw the velocities of the half step before.
    const double l_i = 1.0 - 0.5 * s.delta / s.R_i, l_j = 1.0 - 0.5 * s.delta / s.R_j;
    const double v[3] = {p.vx[a] - p.vx[d], p.vy[a] - p.vy[d], p.vz[a] - p.vz[d]};
    double w[3] = {l_i * p.ux[a] + l_j * p.ux[d], l_i * p.uy[a] + l_j * p.uy[d], l_i * p.uz[a] + l_j * p.uz[d]};
    const double* n3 = s.n;
    const double v_n = v[0] * n3[0] + v[1] * n3[1] + v[2] * n3[2];
    const double across[3] = {v[0] - v_n * n3[0], v[1] - v_n * n3[1], v[2] - v_n * n3[2]};
    const double lag = 0.5 * law_.dt / (s.R_i + s.R_j - s.delta) * (w[0] * n3[0] + w[1] * n3[1] + w[2] * n3[2]);
    for (int axis = 0; axis < 3; ++axis) w[axis] += lag * across[axis];
    const double v_t[3] = {across[0] + n3[1] * w[2] - n3[2] * w[1], across[1] + n3[2] * w[0] - n3[0] * w[2],
                           across[2] + n3[0] * w[1] - n3[1] * w[0]};
    const double T[3] = {sign * b.tx[k], sign * b.ty[k], sign * b.tz[k]};
    const double size = std::sqrt(T[0] * T[0] + T[1] * T[1] + T[2] * T[2]);
    // The kernel cut T to its own limit. That differs by the rounding of the distance, much to an overlap of a few nm.
    const double rounding = law_.mu * (law_.k2 / law_.k1) * K1 * 1e-15 * (s.R_i + s.R_j);
    const bool cut = size >= limit * (1.0 - 1e-12) - rounding;
    c.overlap.push_back(s.delta);
    c.plastic_overlap.push_back(overlap_root(law_, b.sp[k]));
    c.normal_force.push_back(law_.f0 + elastic);
    c.damping_force.push_back(-beta_n * v_n);
    for (int axis = 0; axis < 3; ++axis) c.tangential_force.push_back(T[axis] - (cut || k_t == 0.0 ? 0.0 : beta_t * v_t[axis]));
    const double tolerance = 1e-12 * power;
    const Branch branch = b.sp[k] <= law_.sp_lower * power + tolerance                        ? Branch::loading
                          : law_.k_adh > 0.0 && b.sp[k] >= law_.sp_upper * power - tolerance ? Branch::adhesive
                          : law_.k_adh == 0.0 && b.sp[k] >= power - tolerance                ? Branch::adhesive
                                                                                            : Branch::elastic;
    c.branch.push_back(static_cast<std::int8_t>(branch));
  }
  PlateContactFields& plates = out.plate_contacts;
  for (const PlateHistory& h : plate_history(batches_, particles_)) {
    plates.id.push_back(p.id_of_rank[static_cast<std::size_t>(h.rank)]);
    plates.plate.push_back(static_cast<std::int8_t>(h.plate));
    plates.overlap.push_back(h.overlap);
    plates.force.insert(plates.force.end(), h.record, h.record + 3);
  }
  return out;
}

std::uint64_t Simulation::state_hash(const std::string& extra) {
  const FloatMode mode;
  ensure_forces();
  XXH3_state_t* state = XXH3_createState();
  XXH3_64bits_reset(state);
  const auto put = [&](const void* data, std::size_t size) { XXH3_64bits_update(state, data, size); };
  const auto number = [&](double x) {
    x += 0.0;  // -0 as +0
    put(&x, sizeof x);
  };
  const Particles& p = particles_;
  for (const std::int32_t place : p.places()) {
    const auto k = static_cast<std::size_t>(place);
    for (const auto* column : {&p.x, &p.y, &p.z, &p.vx, &p.vy, &p.vz, &p.ux, &p.uy, &p.uz}) number((*column)[k]);
    const std::int32_t boxes[2] = {p.boxes(k, 0), p.boxes(k, 1)};
    put(boxes, sizeof boxes);
  }
  std::vector<PairHistory> pairs = pair_history(batches_, particles_).pairs.in_a_row();
  std::sort(pairs.begin(), pairs.end(),
            [](const PairHistory& a, const PairHistory& b) { return std::tie(a.low, a.high) < std::tie(b.low, b.high); });
  for (const PairHistory& h : pairs) {
    // k_t of the last step serves the ledger alone, which must not change the hash.
    if (h.sp == 0.0 && h.tx == 0.0 && h.ty == 0.0 && h.tz == 0.0) continue;
    put(&h.low, sizeof h.low), put(&h.high, sizeof h.high);
    for (double x : {h.sp, h.tx, h.ty, h.tz}) number(x);
  }
  for (const PlateHistory& h : plate_history(batches_, particles_)) {
    put(&h.rank, sizeof h.rank), put(&h.plate, sizeof h.plate);
    for (double x : {h.xi_x, h.xi_y, h.xi_z}) number(x);
  }
  put(&step_, sizeof step_);
  put(extra.data(), extra.size());
  const std::uint64_t hash = XXH3_64bits_digest(state);
  XXH3_freeState(state);
  return hash;
}

StepLimits Simulation::limits_of_network(std::string* ruled_by) {
  const FloatMode mode;
  ensure_forces();
  std::vector<NetworkBody> bodies;
  bodies.reserve(static_cast<std::size_t>(particles_.count));
  for (const std::int32_t place : particles_.places()) bodies.push_back({particles_.mass_of(place), particles_.radius_of(place)});
  std::vector<StiffContact> contacts;
  std::vector<int> plates;  // of the contacts behind those of pairs
  for (const Batch& b : batches_)
    for (std::size_t k = 0; k < static_cast<std::size_t>(b.used); ++k) {
      const std::int32_t ri = particles_.rank[static_cast<std::size_t>(b.i(k))], rj = particles_.rank[static_cast<std::size_t>(b.j(k))];
      const PairState s = ri < rj ? pair_state(particles_, domain_, b.i(k), b.j(k)) : pair_state(particles_, domain_, b.j(k), b.i(k));
      if (!(s.delta > 0.0)) continue;
      const double K1 = loading_slope(law_, s.delta);
      const double beta = std::sqrt(law_.damping * s.m_eff * K1);
      contacts.push_back({std::min(ri, rj), std::max(ri, rj), {s.n[0], s.n[1], s.n[2]}, s.R_i - 0.5 * s.delta, s.R_j - 0.5 * s.delta,
                          law_.k2 / law_.k1 * K1, law_.ratio * K1, beta, beta * law_.beta_ratio});
    }
  std::sort(contacts.begin(), contacts.end(), [](const StiffContact& a, const StiffContact& b) { return a.i != b.i ? a.i < b.i : a.j < b.j; });
  for (const PlateHistory& h : plate_history(batches_, particles_)) {
    if (!(h.overlap > 0.0)) continue;
    const NetworkBody& body = bodies[static_cast<std::size_t>(h.rank)];
    const Plane shape = plane_shape(h.plate);
    StiffContact contact;
    contact.i = h.rank;
    contact.n[shape.axis] = shape.sign;
    contact.a_i = body.radius - h.overlap;
    const double root = std::sqrt(body.radius * h.overlap);
    contact.k_n = plate_law_.stiffness_n * root, contact.k_t = plate_law_.stiffness_t * root;
    contact.c_n = std::sqrt(plate_law_.damping * body.mass * contact.k_n);
    contact.c_t = std::sqrt(plate_law_.damping * body.mass * contact.k_t);
    contacts.push_back(contact);
    plates.push_back(h.plate);
  }
  StepLimitOptions options;
  options.find_ruling = ruled_by != nullptr;
  options.pairs_alone = true;
  const StepLimits limits = platen::step_limits(bodies, contacts, {}, options);
  if (ruled_by && limits.ruling_contact >= 0) {
    const auto at = static_cast<std::size_t>(limits.ruling_contact), pairs = contacts.size() - plates.size();
    const StiffContact& c = contacts[at];
    const auto id = [this](int rank) { return std::to_string(particles_.id_of_rank[static_cast<std::size_t>(rank)]); };
    constexpr const char* names[plate_count] = {"the bottom plate", "the top plate", "a wall", "a wall", "a wall", "a wall"};
    *ruled_by = at < pairs ? "spheres " + id(c.i) + " and " + id(c.j) : "sphere " + id(c.i) + " and " + names[plates[at - pairs]];
  }
  return limits;
}

void Simulation::fail(const std::string& what) {
  std::string text = what + " at step " + std::to_string(step_) + " (t = " + std::to_string(time()) + " s)";
  int named = 0;
  char line[600];
  const auto id = [this](std::int32_t k) {
    return static_cast<long long>(particles_.id_of_rank[static_cast<std::size_t>(particles_.rank[static_cast<std::size_t>(k)])]);
  };
  // Spheres that are no numbers or absurdly fast; then the pair that is worst off; then spheres in plates.
  for (std::int32_t k = 0; k < particles_.count && named < 2; ++k) {
    const auto a = static_cast<std::size_t>(k);
    const double sum = particles_.x[a] + particles_.y[a] + particles_.z[a] + particles_.vx[a] + particles_.vy[a] +
                       particles_.vz[a] + particles_.ux[a] + particles_.uy[a] + particles_.uz[a];
    const double speeds = std::fabs(particles_.vx[a]) + std::fabs(particles_.vy[a]) + std::fabs(particles_.vz[a]) + std::fabs(particles_.ux[a]) +
                          std::fabs(particles_.uy[a]) + std::fabs(particles_.uz[a]);
    if (std::isfinite(sum) && speeds < 1e6) continue;
    const double R = particles_.radius_of(k);
    std::snprintf(line, sizeof line, "; sphere %lld at (%g, %g, %g) m moves at (%g, %g, %g) m/s, turns at (%g, %g, %g) rad/s", id(k), particles_.x[a],
                  particles_.y[a], particles_.z[a], particles_.vx[a], particles_.vy[a], particles_.vz[a], particles_.ux[a] / R, particles_.uy[a] / R,
                  particles_.uz[a] / R);
    text += line;
    ++named;
  }
  // How near a pair is to what is not credible: overlap over R, forces over their bound; 1 is too much.
  const Batch* worst_batch = nullptr;
  std::size_t worst = 0;
  double severity = 0.5;
  for (const Batch& b : batches_)
    for (std::size_t k = 0; k < static_cast<std::size_t>(b.used); ++k) {
      const PairState s = pair_state(particles_, domain_, b.i(k), b.j(k));
      if (!(s.delta > 0.0)) continue;
      const double normal = law_.f0 + law_.k2 * (overlap_power(law_, s.delta) - b.sp[k]);
      const double spring = std::sqrt(b.tx[k] * b.tx[k] + b.ty[k] * b.ty[k] + b.tz[k] * b.tz[k]);
      const double here = std::isfinite(normal + spring) ? std::max({s.delta / std::min(s.R_i, s.R_j), std::fabs(normal) / law_.force.bound, spring / law_.force.bound})
                                                         : std::numeric_limits<double>::infinity();
      if (here > severity) severity = here, worst_batch = &b, worst = k;
    }
  if (worst_batch != nullptr) {
    const Batch& b = *worst_batch;
    const PairState s = pair_state(particles_, domain_, b.i(worst), b.j(worst));
    const auto i = static_cast<std::size_t>(b.i(worst)), j = static_cast<std::size_t>(b.j(worst));
    const double R = std::min(s.R_i, s.R_j);
    const double approach = (particles_.vx[j] - particles_.vx[i]) * s.n[0] + (particles_.vy[j] - particles_.vy[i]) * s.n[1] +
                            (particles_.vz[j] - particles_.vz[i]) * s.n[2];
    std::snprintf(line, sizeof line,
                  "; spheres %lld at (%g, %g, %g) m and %lld at (%g, %g, %g) m overlap by %.2f R (plastic %.2f R), approach at %g m/s, push with %g N, rub with %g N",
                  id(b.i(worst)), particles_.x[i], particles_.y[i], particles_.z[i], id(b.j(worst)), particles_.x[j], particles_.y[j], particles_.z[j],
                  s.delta / R, overlap_root(law_, b.sp[worst]) / R, approach, law_.f0 + law_.k2 * (overlap_power(law_, s.delta) - b.sp[worst]),
                  std::sqrt(b.tx[worst] * b.tx[worst] + b.ty[worst] * b.ty[worst] + b.tz[worst] * b.tz[worst]));
    text += line;
    ++named;
  }
  const auto sphere = [&](std::int32_t k, const char* what_of_it) {
    const auto a = static_cast<std::size_t>(k);
    std::snprintf(line, sizeof line, "; sphere %lld at (%g, %g, %g) m %s", id(k), particles_.x[a], particles_.y[a], particles_.z[a], what_of_it);
    text += line;
    ++named;
  };
  for (std::int32_t k = 0; k < particles_.count && named < 3; ++k) {
    const auto a = static_cast<std::size_t>(k);
    const double x[3] = {particles_.x[a], particles_.y[a], particles_.z[a]};
    for (int plate = 0; plate < plate_count; ++plate) {
      if (!planes_[static_cast<std::size_t>(plate)].present) continue;
      const Plane shape = plane_shape(plate);
      if (shape.sign * (x[shape.axis] - plane_position(plate)) < 0.5 * particles_.radius_of(k)) {
        sphere(k, "is in or beyond a plate or wall");
        break;
      }
    }
  }
  if (named == 0 && particles_.count > 0) {
    std::int32_t fastest = 0;
    double most = -1.0;
    for (std::int32_t k = 0; k < particles_.count; ++k) {
      const auto a = static_cast<std::size_t>(k);
      const double v2 = particles_.vx[a] * particles_.vx[a] + particles_.vy[a] * particles_.vy[a] + particles_.vz[a] * particles_.vz[a];
      if (v2 > most) most = v2, fastest = k;
    }
    sphere(fastest, ("is the fastest, " + std::to_string(std::sqrt(most)) + " m/s").c_str());
  }
  throw RunError(text + "; lower speeds (of plates and falling spheres), stiffer contacts or a smaller time step help");
}

}  // namespace platen
