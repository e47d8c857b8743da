#include "bench/scalar_step.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/law_constants.h"
#include "core/morton_order.h"
#include "core/neighbours.h"

namespace platen::bench {

namespace {

double nearest(double d, double length) { return d - length * std::nearbyint(d / length); }

}  // namespace

bool ScalarStep::available() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }

ScalarStep::ScalarStep(const Bed& bed, const BenchScene& scene) {
  const PairLaw& law = scene.law;
  if (!scene.periodic || scene.spread != 0.0 || law.exponent != 1.0 || law.rolling_model != RollingModel::absolute)
    throw std::invalid_argument("the scalar step has periodic sides, equal spheres, exponent 1 and absolute rolling");
  const LawConstants pair = pair_constants(law);
  const PlateConstants plate = plate_constants(scene.plate);
  c_.R = bed.R, c_.m = sphere_mass(bed.R, bed.density), c_.gravity = scene.gravity;
  c_.width = bed.width, c_.depth = bed.depth;
  c_.k1 = pair.k1, c_.k2 = pair.k2, c_.k_adh = pair.k_adh, c_.f0 = pair.f0, c_.mu = pair.mu, c_.mu_r = pair.mu_r;
  c_.k_t = pair.k_t, c_.sp_lower = pair.sp_lower, c_.sp_upper = pair.sp_upper;
  c_.beta_n = std::sqrt(pair.damping * 0.5 * c_.m * pair.k1), c_.beta_t = c_.beta_n * pair.beta_ratio;
  c_.plastic_loading = pair.plastic_loading, c_.plastic_adhesive = pair.plastic_adhesive;
  c_.hertz = plate.hertz, c_.S_n = plate.stiffness_n, c_.S_t = plate.stiffness_t, c_.plate_damping = plate.damping;
  c_.plate_mu = plate.mu, c_.plate_mu_r = plate.mu_r, c_.slip_ratio = plate.slip_ratio;
  plates_ = scene.plates;
  plate_origin_[1] = scene.top ? bed.height : 1e3 * bed.height;
  plate_velocity_[1] = scene.top ? -0.01 : 0.0;
  skin_ = 0.1 * bed.R;

  const std::size_t n = bed.size();
  Particles p;
  p.resize(static_cast<std::int32_t>(n), true);
  p.common_radius = bed.R;
  for (std::size_t k = 0; k < n; ++k) {
    const auto wrapped = [](double x, double length) {
      x -= length * std::floor(x / length);
      return x < length ? x : 0.0;
    };
    p.x[k] = wrapped(bed.position[3 * k], bed.width), p.y[k] = wrapped(bed.position[3 * k + 1], bed.depth);
    p.z[k] = bed.position[3 * k + 2];
  }
  order_ = morton_order(p);
  spheres_.resize(n), sums_.resize(n), rolling_strength_.resize(n);
  for (std::size_t k = 0; k < n; ++k) {
    const auto from = static_cast<std::size_t>(order_[k]);
    ScalarSphere& s = spheres_[k];
    s.x[0] = p.x[from], s.x[1] = p.y[from], s.x[2] = p.z[from];
    for (std::size_t axis = 0; axis < 3; ++axis)
      s.v[axis] = bed.velocity[3 * from + axis], s.u[axis] = bed.R * bed.spin[3 * from + axis];
  }
  rebuild();
  forces(0.0);
}

ScalarBed ScalarStep::view() {
  return {spheres_.data(), sums_.data(),    start_.data(),
          partner_.data(), history_.data(), static_cast<std::int32_t>(spheres_.size())};
}

// A cell list, then every pair closer than 2R + skin once, with the history of pairs that were listed before.
void ScalarStep::rebuild() {
  const double reach = 2.0 * c_.R + skin_, reach2 = reach * reach;
  double low = spheres_[0].x[2], high = low;
  for (const ScalarSphere& s : spheres_) low = std::min(low, s.x[2]), high = std::max(high, s.x[2]);
  const double extent[3] = {c_.width, c_.depth, std::max(high - low, reach)}, origin[3] = {0.0, 0.0, low};
  int cells[3];
  for (int axis = 0; axis < 3; ++axis) cells[axis] = std::max(1, static_cast<int>(extent[axis] / reach));
  if (cells[0] < 3 || cells[1] < 3)
    throw std::invalid_argument("the scalar step wants a box at least three cells wide");
  const auto cell = [&](const ScalarSphere& s, int axis) {
    return std::clamp(static_cast<int>((s.x[axis] - origin[axis]) / extent[axis] * cells[axis]), 0, cells[axis] - 1);
  };
  const auto index = [&](int a, int b, int d) {
    return (static_cast<std::size_t>(d) * static_cast<std::size_t>(cells[1]) + static_cast<std::size_t>(b)) *
               static_cast<std::size_t>(cells[0]) +
           static_cast<std::size_t>(a);
  };
  const auto n = static_cast<std::int32_t>(spheres_.size());
  std::vector<std::int32_t> head(index(cells[0] - 1, cells[1] - 1, cells[2] - 1) + 1, -1), next(spheres_.size(), -1);
  for (std::int32_t k = n; k-- > 0;) {
    const ScalarSphere& s = spheres_[static_cast<std::size_t>(k)];
    std::int32_t& first = head[index(cell(s, 0), cell(s, 1), cell(s, 2))];
    next[static_cast<std::size_t>(k)] = first;
    first = k;
  }
  std::vector<std::int32_t> start, partner, close;
  std::vector<ScalarHistory> history;
  start.reserve(spheres_.size() + 1), partner.reserve(partner_.size()), history.reserve(history_.size());
  start.push_back(0);
  for (std::int32_t i = 0; i < n; ++i) {
    const ScalarSphere& a = spheres_[static_cast<std::size_t>(i)];
    const int at[3] = {cell(a, 0), cell(a, 1), cell(a, 2)};
    close.clear();
    for (int dz = std::max(0, at[2] - 1); dz <= std::min(cells[2] - 1, at[2] + 1); ++dz)
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          const int x = (at[0] + dx + cells[0]) % cells[0], y = (at[1] + dy + cells[1]) % cells[1];
          for (std::int32_t j = head[index(x, y, dz)]; j >= 0; j = next[static_cast<std::size_t>(j)]) {
            if (j <= i) continue;
            const ScalarSphere& b = spheres_[static_cast<std::size_t>(j)];
            const double ex = nearest(a.x[0] - b.x[0], c_.width), ey = nearest(a.x[1] - b.x[1], c_.depth),
                         ez = a.x[2] - b.x[2];
            if (ex * ex + ey * ey + ez * ez < reach2) close.push_back(j);
          }
        }
    std::sort(close.begin(), close.end());
    std::size_t old = start_.empty() ? 0 : static_cast<std::size_t>(start_[static_cast<std::size_t>(i)]);
    const std::size_t old_end = start_.empty() ? 0 : static_cast<std::size_t>(start_[static_cast<std::size_t>(i) + 1]);
    for (const std::int32_t j : close) {
      while (old < old_end && partner_[old] < j) ++old;
      partner.push_back(j);
      history.push_back(old < old_end && partner_[old] == j ? history_[old] : ScalarHistory{});
    }
    start.push_back(static_cast<std::int32_t>(partner.size()));
  }
  start_.swap(start), partner_.swap(partner), history_.swap(history);

  for (int plate = 0; plates_ && plate < 2; ++plate) {
    const double position =
        plate_origin_[plate] + plate_velocity_[plate] * static_cast<double>(step_) * bench_step_size;
    std::vector<ScalarPlateContact> contacts, &before = plate_contacts_[plate];
    auto old = before.begin();
    for (std::int32_t k = 0; k < n; ++k) {
      if (std::fabs(spheres_[static_cast<std::size_t>(k)].x[2] - position) > c_.R + 2.0 * skin_) continue;
      while (old != before.end() && old->sphere < k) ++old;
      contacts.push_back(old != before.end() && old->sphere == k ? *old : ScalarPlateContact{k, {0, 0, 0}, 0});
    }
    before.swap(contacts);
  }
  at_rebuild_.resize(3 * spheres_.size());
  for (std::size_t k = 0; k < spheres_.size(); ++k)
    std::copy_n(spheres_[k].x, 3, at_rebuild_.begin() + 3 * static_cast<std::ptrdiff_t>(k));
  moved_ = plate_moved_ = 0.0;
  ++rebuilds_;
}

void ScalarStep::forces(double dt) {
  const ScalarBed bed = view();
  touching_ = scalar_forces(bed, c_, dt, ledger_);
  if (!plates_) return;
  std::fill(rolling_strength_.begin(), rolling_strength_.end(), 0.0);
  for (int k = 0; k < 2; ++k) {
    const ScalarPlate plate = {
        k == 0 ? 1.0 : -1.0, plate_origin_[k] + plate_velocity_[k] * static_cast<double>(step_) * bench_step_size,
        plate_velocity_[k], plate_contacts_[k].data(), static_cast<std::int32_t>(plate_contacts_[k].size())};
    scalar_plate_forces(bed, c_, plate, dt, rolling_strength_.data(), ledger_);
  }
}

void ScalarStep::advance(std::int64_t steps) {
  const double dt = bench_step_size;
  for (std::int64_t k = 0; k < steps; ++k) {
    const double speed2 = scalar_motion(view(), c_, 0.5 * (last_drift_ + dt), dt, rolling_strength_.data(), ledger_);
    last_drift_ = dt;
    ++step_;
    moved_ += std::sqrt(speed2) * dt;
    plate_moved_ += std::fabs(plate_velocity_[1]) * dt;
    // The sum of the largest speeds is a bound; only where it is used up are the spheres themselves looked at.
    if (2.0 * moved_ > skin_) moved_ = displaced();
    if (2.0 * moved_ > 0.8 * skin_ || moved_ + plate_moved_ > 2.0 * skin_) rebuild();
    forces(dt);
  }
}

double ScalarStep::displaced() const {
  double largest = 0.0;
  for (std::size_t k = 0; k < spheres_.size(); ++k) {
    const double dx = nearest(spheres_[k].x[0] - at_rebuild_[3 * k], c_.width);
    const double dy = nearest(spheres_[k].x[1] - at_rebuild_[3 * k + 1], c_.depth);
    const double dz = spheres_[k].x[2] - at_rebuild_[3 * k + 2];
    largest = std::max(largest, dx * dx + dy * dy + dz * dz);
  }
  return std::sqrt(largest);
}

std::vector<double> ScalarStep::positions() const {
  std::vector<double> all(3 * spheres_.size());
  for (std::size_t k = 0; k < spheres_.size(); ++k) std::copy_n(spheres_[k].x, 3, all.begin() + 3 * order_[k]);
  return all;
}

double scalar_difference(const Bed& bed, const BenchScene& scene, int steps) {
  BenchEngine engine;
  engine.set = available_instruction_sets().back();
  const auto sim = make_simulation(bed, scene, engine);
  ScalarStep scalar(bed, scene);
  sim->advance(steps);
  scalar.advance(steps);
  const std::vector<double> ours = sim->snapshot(false).particles.position, theirs = scalar.positions();
  double largest = 0.0;
  for (std::size_t k = 0; k < ours.size(); ++k) {
    double d = ours[k] - theirs[k];
    if (k % 3 == 0) d = nearest(d, bed.width);
    if (k % 3 == 1) d = nearest(d, bed.depth);
    largest = std::max(largest, std::fabs(d));
  }
  return largest / bed.R;
}

}  // namespace platen::bench
