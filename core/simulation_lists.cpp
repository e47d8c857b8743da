// Lists of a Simulation: when they are made anew and how wide, and the state to which a run of steps can go back.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/float_mode.h"
#include "core/simulation_detail.h"

namespace platen {

namespace {
constexpr double usual_skin = 0.25, widest_skin = 1.0;  // of the largest radius
constexpr double smallest_gap = 0.02;                   // of the largest radius
constexpr double caution = 1.2;                         // speeds may grow within a run of steps
}  // namespace

// Total of each particle's sums, by rank: forces outlive the lists they were found with.
void Simulation::keep_sums(AlignedArray<double>& sums) {
  sums.resize(static_cast<std::size_t>(particles_.count) * record_size);
  parallel(static_cast<int>(batches_.size()), [&](int k) {
    Batch& b = batches_[static_cast<std::size_t>(k)];
    if (!merged_[static_cast<std::size_t>(k)]) merge(b);
    merged_[static_cast<std::size_t>(k)] = 1;
    for (std::int32_t m = 0; m < b.count && b.first + m < particles_.count; ++m) {
      double* to = sums.data() + record_size * static_cast<std::size_t>(particles_.rank[static_cast<std::size_t>(b.first + m)]);
      for (int field = 0; field < record_size; ++field) {
        const auto at = record_size * static_cast<std::size_t>(m) + static_cast<std::size_t>(field);
        to[field] = b.sum_i[at] + b.sum_j[at];
      }
    }
  });
}

void Simulation::put_sums(const AlignedArray<double>& sums) {
  merged_.assign(batches_.size(), 1);
  parallel(static_cast<int>(batches_.size()), [&](int k) {
    Batch& b = batches_[static_cast<std::size_t>(k)];
    for (std::int32_t m = 0; m < b.count && b.first + m < particles_.count; ++m) {
      const auto rank = static_cast<std::size_t>(particles_.rank[static_cast<std::size_t>(b.first + m)]);
      std::copy_n(sums.data() + record_size * rank, record_size, b.sum_j.data() + record_size * static_cast<std::size_t>(m));
    }
  });
}

void Simulation::remember(AlignedArray<double>& reference, double (&drift)[3]) {
  const auto n = static_cast<std::size_t>(particles_.count);
  reference.resize(3 * n);
  std::copy_n(particles_.x.data(), n, reference.data());
  std::copy_n(particles_.y.data(), n, reference.data() + n);
  std::copy_n(particles_.z.data(), n, reference.data() + 2 * n);
  std::fill(drift, drift + 3, 0.0);
}

// Largest displacement since the positions were remembered, relative to the common drift [m].
double Simulation::displaced(const AlignedArray<double>& reference, const double (&drift)[3]) {
  const auto n = static_cast<std::size_t>(particles_.count);
  std::vector<double> largest(batches_.size(), 0.0);
  parallel(static_cast<int>(batches_.size()), [&](int k) {
    const Batch& b = batches_[static_cast<std::size_t>(k)];
    double most = 0.0;
    const auto end = std::min(static_cast<std::size_t>(b.first + b.count), n);
    for (auto m = static_cast<std::size_t>(b.first); m < end; ++m) {
      const double dx = domain_.nearest_x(particles_.x[m] - reference[m] - drift[0]);
      const double dy = domain_.nearest_y(particles_.y[m] - reference[n + m] - drift[1]);
      const double dz = particles_.z[m] - reference[2 * n + m] - drift[2];
      most = std::max(most, dx * dx + dy * dy + dz * dz);
    }
    largest[static_cast<std::size_t>(k)] = most;
  });
  return std::sqrt(*std::max_element(largest.begin(), largest.end()));
}

// The common velocity, and the largest one relative to it.
void Simulation::mean_velocity() {
  const auto n = static_cast<std::size_t>(particles_.count);
  const AlignedArray<double>* columns[3] = {&particles_.vx, &particles_.vy, &particles_.vz};
  for (int axis = 0; axis < 3; ++axis) {
    double sum = 0.0;
    for (std::size_t k = 0; k < n; ++k) sum += (*columns[axis])[k];
    mean_[axis] = n > 0 ? sum / static_cast<double>(n) : 0.0;
  }
  double largest = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const double a = particles_.vx[k] - mean_[0], b = particles_.vy[k] - mean_[1], c = particles_.vz[k] - mean_[2];
    largest = std::max(largest, a * a + b * b + c * c);
  }
  largest_speed_ = std::max(largest_speed_, std::sqrt(largest));
}

// Bound of what a plane moves against the common drift in `steps` steps [m].
double Simulation::plane_path(int steps) const {
  double fastest = 0.0;
  for (int plate = 0; plate < plate_count; ++plate) {
    const PlaneMotion& plane = planes_[static_cast<std::size_t>(plate)];
    if (plane.present) fastest = std::max(fastest, plane.largest_speed() + std::fabs(mean_[plane_shape(plate).axis]));
  }
  return fastest * dt_ * steps;
}

// Makes sure that the lists will hold for some steps, and says for how many: at most `wanted`.
int Simulation::prepare_lists(std::int64_t wanted) {
  const double R = largest_radius_;
  const int n = static_cast<int>(std::min<std::int64_t>(wanted, engine_.unroll));
  // A free fall or a push may add speed within the run; a kick by gravity is the least to expect.
  const auto path = [&](int steps) { return (caution * largest_speed_ + gravity_ * dt_ * steps) * dt_ * steps; };
  if (lists_valid_ && !lists_stale_) {
    moved_ = displaced(at_prune_, drift_at_prune_);
    int fits = n;
    while (fits > 1 && !(2.0 * (moved_ + path(fits)) <= gap_ && moved_ + path(fits) + plane_moved_ + plane_path(fits) <= plate_gap_))
      fits /= 2;
    const bool one = 2.0 * (moved_ + path(1)) <= gap_ && moved_ + path(1) + plane_moved_ + plane_path(1) <= plate_gap_;
    if (one && fits == n) return n;
  }

  mean_velocity();
  double widest = widest_skin * R;
  if (periodic()) widest = std::max(0.0, 0.5 * std::min(domain_.width, domain_.depth) - 2.0 * R);
  const double skin_wish = engine_.skin > 0.0 ? engine_.skin : usual_skin * R;
  const double gap_wish = engine_.inner_gap > 0.0 ? engine_.inner_gap : std::max(smallest_gap * R, 3.0 * path(n));
  const double most = std::min(widest, std::max(skin_wish, widest_skin * R));
  double gap = std::min(gap_wish, 0.5 * most);
  if (2.0 * path(1) * caution > gap) gap = 2.0 * path(1) * caution;
  if (gap > most) fail("a sphere moves " + std::to_string(path(1) / R) + " radii in one step: more than lists can follow; use a smaller time step");
  gap_ = gap;
  plate_gap_ = std::max({0.3 * R, gap, 4.0 * (path(n) + plane_path(n))});

  const bool rebuilt = !lists_valid_ || 2.0 * displaced(at_rebuild_, drift_at_rebuild_) + gap_ > skin_;
  if (rebuilt) {
    skin_ = std::min(most, std::max(skin_wish, 2.0 * gap_));
    skin_ = std::max(skin_, gap_);
    rebuild();
  } else {
    prune_lists();
  }
  moved_ = 0.0;
  lists_stale_ = false;
  int fits = n;
  while (fits > 1 && !(2.0 * path(fits) <= gap_ && path(fits) + plane_path(fits) <= plate_gap_)) fits /= 2;
  return fits;
}

void Simulation::prune_lists() {
  AlignedArray<double> sums;
  keep_sums(sums);
  const auto plates = plate_history(batches_, particles_);
  const auto run = [this](int count, const std::function<void(int)>& body) { parallel(count, body); };
  prune(batches_, particles_, domain_, gap_, keeps_k_t(), run);
  list_plates(batches_, particles_, planes_, step_, plate_gap_, plates, run);
  put_sums(sums);
  remember(at_prune_, drift_at_prune_);
  plane_moved_ = 0.0;
  ++counters_.prunes;
}

void Simulation::rebuild() { rebuild_with(pair_history(batches_, particles_)); }

void Simulation::rebuild_with(std::vector<PairHistory> pairs) {
  if (skin_ == 0.0) {
    skin_ = engine_.skin > 0.0 ? engine_.skin : usual_skin * largest_radius_;
    gap_ = engine_.inner_gap > 0.0 ? std::min(engine_.inner_gap, skin_) : smallest_gap * largest_radius_;
    plate_gap_ = 0.3 * largest_radius_;
  }
  AlignedArray<double> sums;
  const bool had_forces = !batches_.empty();
  if (had_forces) keep_sums(sums);
  const auto plates = plate_history(batches_, particles_);
  const auto run = [this](int count, const std::function<void(int)>& body) { parallel(count, body); };
  particles_.permute(morton_order(particles_));
  const int automatic = std::clamp(particles_.count / (16 * std::max(1, engine_.threads)) / padding * padding, 128, 1024);
  graph_.reset();
  table_.reset();
  batches_ = make_batches(particles_, domain_, skin_, engine_.batch > 0 ? engine_.batch : automatic, run);
  fill_inner(batches_, particles_, domain_, gap_, keeps_k_t(), pairs, run);
  list_plates(batches_, particles_, planes_, step_, plate_gap_, plates, run);
  merged_.assign(batches_.size(), 1);
  if (had_forces) put_sums(sums);
  // The graph is as long as a usual run between two looks; a thousand batches need no long graphs to keep cores busy.
  unroll_ = engine_.unroll;
  prepare_graph();
  remember(at_rebuild_, drift_at_rebuild_);
  remember(at_prune_, drift_at_prune_);
  plane_moved_ = 0.0;
  lists_valid_ = true;
  ++counters_.rebuilds;
  counters_.batches = static_cast<int>(batches_.size());
  counters_.skin = skin_, counters_.gap = gap_;
}

void Simulation::rebuild_now() {
  const FloatMode mode;
  ensure_forces();
  rebuild();
}

void Simulation::open_sides() {
  if (!periodic()) return;
  const FloatMode mode;
  ensure_forces();
  // Every centre is inside the box already; pairs that met through a face are apart from now on.
  FixedSum before(energy_unit_), after(energy_unit_);
  std::vector<PairHistory> kept;
  add_pair_energy(before);
  for (const PairHistory& h : pair_history(batches_, particles_)) {
    const auto a = static_cast<std::size_t>(particles_.place[static_cast<std::size_t>(h.low)]);
    const auto b = static_cast<std::size_t>(particles_.place[static_cast<std::size_t>(h.high)]);
    const double dx = particles_.x[a] - particles_.x[b], dy = particles_.y[a] - particles_.y[b];
    if (domain_.nearest_x(dx) == dx && domain_.nearest_y(dy) == dy) kept.push_back(h);
  }
  domain_ = {};
  law_.width = law_.depth = law_.inverse_width = law_.inverse_depth = 0.0;
  motion_.width = motion_.depth = 0.0;
  rebuild_with(std::move(kept));
  add_pair_energy(after);
  removed_ += before.value() - after.value();
  forces_valid_ = false;
}

void Simulation::save() {
  const auto n = static_cast<std::size_t>(particles_.padded);
  Saved& s = *saved_;
  s.columns.resize(9 * n);
  s.image.resize(2 * n);
  s.batches.resize(batches_.size());
  parallel(static_cast<int>(batches_.size()), [&](int k) {
    Batch& b = batches_[static_cast<std::size_t>(k)];
    const auto first = static_cast<std::size_t>(b.first), count = static_cast<std::size_t>(b.count);
    int column = 0;
    for (auto* a : {&particles_.x, &particles_.y, &particles_.z, &particles_.vx, &particles_.vy, &particles_.vz,
                    &particles_.ux, &particles_.uy, &particles_.uz})
      std::copy_n(a->data() + first, count, s.columns.data() + static_cast<std::size_t>(column++) * n + first);
    std::copy_n(particles_.image.data() + 2 * first, 2 * count, s.image.data() + 2 * first);
    Saved::OfBatch& to = s.batches[static_cast<std::size_t>(k)];
    if (!merged_[static_cast<std::size_t>(k)]) merge(b);
    merged_[static_cast<std::size_t>(k)] = 1;
    for_each_history(b, [&](std::size_t size) { to.history.resize(size); },
                     [&](double* data, std::size_t size, std::size_t at) { std::copy_n(data, size, to.history.data() + at); });
    to.sums.resize(count * record_size);
    for (std::size_t m = 0; m < count * record_size; ++m) to.sums[m] = b.sum_i[m] + b.sum_j[m];
    to.contacts = b.pair_totals.contacts;
  });
}

void Simulation::restore() {
  const auto n = static_cast<std::size_t>(particles_.padded);
  const Saved& s = *saved_;
  int column = 0;
  for (auto* a : {&particles_.x, &particles_.y, &particles_.z, &particles_.vx, &particles_.vy, &particles_.vz,
                  &particles_.ux, &particles_.uy, &particles_.uz})
    std::copy_n(s.columns.data() + static_cast<std::size_t>(column++) * n, n, a->data());
  std::copy_n(s.image.data(), 2 * n, particles_.image.data());
  particles_.write_rows();
  for (std::size_t k = 0; k < batches_.size(); ++k) {
    Batch& b = batches_[k];
    const Saved::OfBatch& from = s.batches[k];
    for_each_history(b, [](std::size_t) {},
                     [&](double* data, std::size_t size, std::size_t at) { std::copy_n(from.history.data() + at, size, data); });
    std::fill(b.sum_i.begin(), b.sum_i.end(), 0.0);
    std::copy_n(from.sums.data(), from.sums.size(), b.sum_j.data());
    merged_[k] = 1;
    const auto contacts = from.contacts;
    b.pair_totals = {};
    b.pair_totals.contacts = contacts;
    std::fill(std::begin(b.plate_energy), std::end(b.plate_energy), 0);
    b.plate_work = b.rolling = 0;
    b.out_of_range = false;
  }
}

}  // namespace platen
