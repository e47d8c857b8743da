// Lists of a Simulation: when they are made anew and how wide, and the state to which a run of steps can go back.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/float_mode.h"
#include "core/morton_order.h"
#include "core/simulation_detail.h"

namespace platen {

namespace {
// Margins, in largest radii: of a sphere at rest, and how much wider the outer ones are.
constexpr double smallest_inner = 0.003, smallest_outer = 0.08;
constexpr double widest = 0.5;
constexpr double caution = 1.2;           // speeds may grow until the lists are looked at again
// What rounding may have taken off a sum of that many squared speeds, of single precision. (Speeds below 1e-19 m/s count as none.)
double with_rounding(int steps) { return 1.0 + steps * 0x1p-23; }
constexpr int shortest_horizon = 16, longest_horizon = 512;  // steps from prune to prune
constexpr int outer_life = 16;             // horizons from rebuild to rebuild of a bed in steady motion
constexpr int worthwhile = 8;             // steps that lists must still hold, lest they are made anew
// What it costs to look at a pair in the kernel, at a pair of the outer list in a prune, and a prune for each sphere.
constexpr double pair_cost = 10.0, outer_cost = 3.0, sphere_cost = 20.0;
}  // namespace

// Adds what other batches hold of each batch's sums, so that every batch has its own in full.
void Simulation::merge_all() {
  parallel(static_cast<int>(batches_.size()), [&](int k) {
    if (!merged_[static_cast<std::size_t>(k)]) merge(batches_[static_cast<std::size_t>(k)]);
    merged_[static_cast<std::size_t>(k)] = 1;
  });
}

// Total of each particle's sums, by rank: forces outlive the batches they were found with.
void Simulation::keep_sums(ChunkedArray<double>& sums) {
  sums.resize_to_overwrite(static_cast<std::size_t>(particles_.count) * record_size);
  merge_all();
  parallel(static_cast<int>(batches_.size()), [&](int k) {
    const Batch& b = batches_[static_cast<std::size_t>(k)];
    for (std::int32_t m = 0; m < b.count && b.first + m < particles_.count; ++m) {
      const auto rank = static_cast<std::size_t>(particles_.rank[static_cast<std::size_t>(b.first + m)]);
      std::copy_n(b.sum.data() + record_size * static_cast<std::size_t>(m), record_size, &sums[record_size * rank]);
    }
  });
}

void Simulation::put_sums(const ChunkedArray<double>& sums) {
  merged_.assign(batches_.size(), 1);
  parallel(static_cast<int>(batches_.size()), [&](int k) {
    Batch& b = batches_[static_cast<std::size_t>(k)];
    for (std::int32_t m = 0; m < b.count && b.first + m < particles_.count; ++m) {
      const auto rank = static_cast<std::size_t>(particles_.rank[static_cast<std::size_t>(b.first + m)]);
      std::copy_n(&sums[record_size * rank], record_size, b.sum.data() + record_size * static_cast<std::size_t>(m));
    }
  });
}

// Inner lists hold from here on.
void Simulation::start_from_here() {
  plane_moved_ = 0.0;
  moved_since_look_ = false;
}

// Speed relative to the common velocity [m/s].
double Simulation::own_speed(std::size_t k) const {
  const double a = particles_.vx[k] - mean_[0], b = particles_.vy[k] - mean_[1], c = particles_.vz[k] - mean_[2];
  return std::sqrt(a * a + b * b + c * c);
}

void Simulation::mean_velocity() {
  struct Sum {
    double v[3] = {0, 0, 0};
  };
  std::vector<Sum> sums(batches_.size());
  parallel(static_cast<int>(batches_.size()), [&](int index) {
    const Batch& b = batches_[static_cast<std::size_t>(index)];
    const AlignedArray<double>* columns[3] = {&particles_.vx, &particles_.vy, &particles_.vz};
    const auto first = static_cast<std::size_t>(b.first), last = static_cast<std::size_t>(std::clamp(particles_.count, b.first, b.first + b.count));
    for (int axis = 0; axis < 3; ++axis) {
      const AlignedArray<double>& v = *columns[axis];
      double part[4] = {0.0, 0.0, 0.0, 0.0};  // side by side: an addition would wait for the one before
      std::size_t k = first;
      for (; k + 4 <= last; k += 4)
        for (std::size_t lane = 0; lane < 4; ++lane) part[lane] += v[k + lane];
      for (; k < last; ++k) part[0] += v[k];
      sums[static_cast<std::size_t>(index)].v[axis] = (part[0] + part[1]) + (part[2] + part[3]);
    }
  });
  for (int axis = 0; axis < 3; ++axis) {
    double sum = 0.0;
    for (const Sum& s : sums) sum += s.v[axis];
    mean_[axis] = particles_.count > 0 ? sum / particles_.count : 0.0;
  }
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

// How long lists should hold [steps]. Longer means wider margins, hence more pairs in every step, and fewer prunes:
// the cheapest is where both cost the same.
void Simulation::choose_horizon() {
  double listed = 0.0, outer = 0.0;
  for (const Batch& b : batches_) listed += b.used, outer += static_cast<double>(b.outer_j.size());
  const auto n = static_cast<std::size_t>(particles_.count);
  const double margin = inner_sum_;
  if (n == 0 || !(margin > 0.0)) return;
  const double least = smallest_inner * largest_radius_ * static_cast<double>(n);
  const double widened = (listed - static_cast<double>(contacts_)) * std::max(0.0, margin - least) / margin;
  const double prune_cost = outer_cost * outer + sphere_cost * static_cast<double>(n);
  const double per_step = pair_cost * std::max(widened, 0.0) / horizon_;
  const double best = per_step > 0.0 ? std::sqrt(prune_cost / per_step) : longest_horizon;
  const double next = std::clamp(best, 0.5 * horizon_, 1.25 * horizon_ + 1.0);  // step by step, lest it swings
  horizon_ = static_cast<int>(std::clamp(next, static_cast<double>(shortest_horizon), static_cast<double>(longest_horizon)));
}

// Widest margin that a sphere may have [m].
double Simulation::widest_margin() const {
  const double wish = std::max(0.5 * engine_.skin, widest * largest_radius_);
  if (!periodic()) return wish;
  return std::min(wish, std::max(0.0, 0.25 * std::min(domain_.width, domain_.depth) - largest_radius_));
}

// Margin without which a sphere of this speed could not take a single step [m].
double Simulation::least_margin(double speed) const { return 1.01 * (caution * speed + gravity_ * dt_) * dt_; }

AlignedArray<double> Simulation::own_speeds() {
  AlignedArray<double> speeds;
  speeds.resize_to_overwrite(static_cast<std::size_t>(particles_.count));
  for_each_in_stretches(speeds.size(), on_workers(), [&](std::size_t k) { speeds[k] = own_speed(k); });
  return speeds;
}

// Sum over the spheres in a fixed order, whoever adds which part.
double Simulation::sum_of(const AlignedArray<double>& column) {
  const auto n = static_cast<std::size_t>(particles_.count);
  std::vector<double> sums(static_cast<std::size_t>(stretches_of(n)));
  parallel(stretches_of(n), [&](int part) {
    const IndexRange range = stretch(n, part);
    double four[4] = {0.0, 0.0, 0.0, 0.0};  // side by side: an addition would wait for the one before
    std::size_t k = range.first;
    for (; k + 4 <= range.last; k += 4)
      for (std::size_t lane = 0; lane < 4; ++lane) four[lane] += column[k + lane];
    for (; k < range.last; ++k) four[0] += column[k];
    sums[static_cast<std::size_t>(part)] = (four[0] + four[1]) + (four[2] + four[3]);
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

// Ends the run where a sphere is too fast for any list. Looked for before lists are touched: what a failure tells, and
// what is still written after it, needs lists and particles that belong together.
void Simulation::check_speeds(const AlignedArray<double>& speeds) {
  double needed = 0.0;
  for (const double speed : speeds) needed = std::max(needed, least_margin(speed));
  if (needed > widest_margin())
    fail("a sphere moves " + std::to_string(needed / largest_radius_) +
         " radii in one step: more than lists can follow; use a smaller time step");
}

// Margins that hold for about a horizon at these speeds; outer ones as well where lists are `fresh`. Else false where what is left of the
// outer ones is too little.
bool Simulation::choose_margins(bool fresh, const AlignedArray<double>& speeds) {
  const auto n = static_cast<std::size_t>(particles_.count);
  const double R = largest_radius_, most = widest_margin();
  const auto padded = static_cast<std::size_t>(particles_.padded);
  inner_.of.resize(padded);
  if (fresh) outer_.of.resize(padded);
  speed2_.resize(padded);
  if (!fresh && moved_since_look_) look_at_spheres();
  // Who is slow may be hit: a sphere's margin is never below what the mean speed, times a factor that grows whenever
  // steps had to be done again, takes.
  const double least_path = n > 0 ? caution * kick_factor_ * sum_of(speeds) / static_cast<double>(n) * dt_ : 0.0;
  kick_factor_ = std::max(1.0, 0.97 * kick_factor_);
  struct Found {
    double inner_sum = 0.0, outer_sum = 0.0, outer_largest = 0.0;
    bool enough = true;
  };
  std::vector<Found> found(static_cast<std::size_t>(stretches_of(n)));
  parallel(stretches_of(n), [&](int part) {
    const IndexRange range = stretch(n, part);
    Found now;
    for (std::size_t k = range.first; k < range.last; ++k) {
      const double path = std::max(caution * speeds[k] * dt_, least_path);  // of one step
      const double needed = least_margin(speeds[k]);
      const double wish = engine_.inner_gap > 0.0 ? 0.5 * engine_.inner_gap : std::max(smallest_inner * R, horizon_ * path);
      double inner = std::min(std::max({wish, redo_margin_, needed}), most);
      if (fresh) {
        const double further = engine_.skin > 0.0 ? 0.5 * engine_.skin : inner + std::max(smallest_outer * R, outer_life * horizon_ * path);
        const double outer = outer_.of[k] = rounded_down(std::clamp(further, inner, most));
        now.outer_sum += outer, now.outer_largest = std::max(now.outer_largest, outer);
      } else {
        const double left = outer_.of[k];  // enough if it lasts for some steps
        now.enough = now.enough && left > 0.0 && left >= std::max({std::min(inner, worthwhile * path), std::min(redo_margin_, most * (1.0 - 1e-6)), needed});
        inner = std::min(inner, left);
      }
      inner = inner_.of[k] = rounded_down(inner);
      now.inner_sum += inner;
    }
    found[static_cast<std::size_t>(part)] = now;
  });
  Found all;
  for (const Found& of : found) {
    all.inner_sum += of.inner_sum;
    all.outer_sum += of.outer_sum, all.outer_largest = std::max(all.outer_largest, of.outer_largest);
    all.enough = all.enough && of.enough;
  }
  inner_sum_ = all.inner_sum;
  if (fresh) outer_.largest = all.outer_largest;
  if (n > 0) counters_.gap = 2.0 * all.inner_sum / static_cast<double>(n);
  if (n > 0 && fresh) counters_.skin = 2.0 * all.outer_sum / static_cast<double>(n);
  plate_gap_ = std::max(0.05 * R, 1.5 * plane_path(horizon_));
  return all.enough;
}

LookConstants Simulation::look_constants() const {
  return {domain_.width, domain_.inverse_width, domain_.depth, domain_.inverse_depth, {drift_since_look_[0], drift_since_look_[1], drift_since_look_[2]},
          {mean_[0], mean_[1], mean_[2]}, std::numeric_limits<double>::infinity()};
}

// After a run of steps in rows: nobody goes back behind it any more.
void Simulation::settle() {
  const LookConstants constants = look_constants();
  parallel(static_cast<int>(batches_.size()), [&](int index) {
    const Batch& b = batches_[static_cast<std::size_t>(index)];
    Particles& p = particles_;
    const auto first = static_cast<std::size_t>(b.first);
    kernels_.settle({p.rows.data() + row_size * first, p.x.data() + first, p.y.data() + first, p.z.data() + first, p.vx.data() + first, p.vy.data() + first, p.vz.data() + first,
                     p.ux.data() + first, p.uy.data() + first, p.uz.data() + first, inner_.of.data() + first, outer_.of.data() + first, b.count},
                    constants);
  });
}

// Takes off the room of each sphere what it has moved in the last run of steps: where that began is still kept, for going back.
LookTotals Simulation::look_at_spheres() {
  const LookConstants constants = look_constants();
  std::vector<LookTotals> found(batches_.size());
  parallel(static_cast<int>(batches_.size()), [&](int index) {
    const Batch& b = batches_[static_cast<std::size_t>(index)];
    const Particles& p = particles_;
    const auto first = static_cast<std::size_t>(b.first);
    const auto then = [&](const AlignedArray<double>& column) { return moved_since_look_ ? column.data() + first : nullptr; };
    const LookBatch batch{p.x.data() + first, p.y.data() + first, p.z.data() + first, p.vx.data() + first, p.vy.data() + first, p.vz.data() + first,
                          then(saved_->x), then(saved_->y), then(saved_->z), inner_.of.data() + first, outer_.of.data() + first, speed2_.data() + first, b.count,
                          std::clamp(p.count - b.first, 0, b.count)};
    kernels_.look(batch, constants, found[static_cast<std::size_t>(index)]);
  });
  moved_since_look_ = false;
  LookTotals all;
  for (const LookTotals& of : found) all.fastest = std::max(all.fastest, of.fastest), all.closest = std::max(all.closest, of.closest);
  return all;
}

// For how many steps, at most `wanted`, the lists will hold if speeds do not grow much; 0 where not for one.
int Simulation::look(int wanted) {
  const LookTotals found = look_at_spheres();
  const double fastest = caution * found.fastest, closest = gravity_ * dt_ * found.closest;
  const auto holds = [&](int steps) {  // a free fall or a push may add speed; a kick by gravity is the least to expect
    return (fastest + closest * steps) * (dt_ * steps) <= 1.0 && plane_moved_ + plane_path(steps) <= plate_gap_;
  };
  int steps = wanted;
  while (steps > 0 && !holds(steps)) steps = steps > 1 ? steps * 3 / 4 : 0;
  return steps;
}

// Whether every sphere stayed within its margin in the last `steps` steps, or else could not have met one that it is not
// listed with. The way of a sphere is at most dt sqrt(steps sum of v^2).
Simulation::Ways Simulation::look_back(int steps) {
  const auto n = static_cast<std::size_t>(particles_.count);
  const double factor = steps * dt_ * dt_ * with_rounding(steps);
  struct Found {
    std::size_t within = 0;
    double sum = 0.0;  // a number only if all are
    // Spins of spheres that touch nobody are in no sum. Eight at a time, for vectors.
    double odd[8] = {};  // stay 0 while all are numbers
  };
  std::vector<Found> found(static_cast<std::size_t>(stretches_of(n)));
  parallel(stretches_of(n), [&](int part) {
    const Particles& p = particles_;
    const IndexRange range = stretch(n, part);
    Found now;
    for (std::size_t k = range.first; k < range.last; ++k) {
      const double speed2 = speed2_[k], room = inner_.of[k];
      now.within += factor * speed2 <= room * room ? 1u : 0u;
      now.sum += speed2;
    }
    std::size_t k = range.first;
    if (moves_in_rows_) {
      for (const double* u = p.rows.data() + row_size * k + 8; k < range.last; ++k, u += row_size) now.odd[k % 8] += 0.0 * (u[0] + u[1] + u[2]);
    } else {
      for (; k + 8 <= range.last; k += 8)
        for (std::size_t lane = 0; lane < 8; ++lane) now.odd[lane] += 0.0 * (p.ux[k + lane] + p.uy[k + lane] + p.uz[k + lane]);
      for (; k < range.last; ++k) now.odd[0] += 0.0 * (p.ux[k] + p.uy[k] + p.uz[k]);
    }
    found[static_cast<std::size_t>(part)] = now;
  });
  std::size_t within = 0;
  for (const Found& part : found) {
    if (!(part.sum < 0x1p60)) return Ways::no_number;  // also a velocity that is a number, but an absurd one
    for (const double x : part.odd)
      if (!(x == 0.0)) return Ways::no_number;
    within += part.within;
  }
  if (within == n) return Ways::within_margins;
  std::vector<char> beyond(n);
  for (std::size_t k = 0; k < n; ++k) {
    const double speed2 = speed2_[k], room = inner_.of[k];
    beyond[k] = !(factor * speed2 <= room * room);
  }
  if (!unlisted_apart(steps, beyond)) return Ways::too_long;
  counters_.spared_steps += steps;
  lists_stale_ = true;  // some sphere has no room left
  return Ways::within_margins;
}

// Whether no pair and no sphere and plane that are not listed can have touched in the last `steps` steps, although spheres
// went `beyond` their margins: most often it is one that was pushed, between others that hardly moved.
bool Simulation::unlisted_apart(int steps, const std::vector<char>& beyond) const {
  const auto n = static_cast<std::size_t>(particles_.count);
  const double factor = dt_ * std::sqrt(steps * with_rounding(steps)), rounding = 1e-9 * largest_radius_;
  const auto way = [&](std::size_t k) { return factor * std::sqrt(static_cast<double>(speed2_[k])) + rounding; };
  const Saved& s = *saved_;
  const Particles& p = particles_;
  const AlignedArray<double>* const columns[3] = {moves_in_rows_ ? &p.x : &s.x, moves_in_rows_ ? &p.y : &s.y, moves_in_rows_ ? &p.z : &s.z};
  const auto before = [&](std::size_t k, std::size_t axis) { return (*columns[axis])[k]; };
  const double planes_moved = plane_path(steps);
  for (std::size_t k = 0; k < n; ++k) {
    if (!beyond[k]) continue;
    if (!(way(k) <= outer_.of[k])) return false;
    for (int plate = 0; plate < plate_count; ++plate) {
      const PlaneMotion& plane = planes_[static_cast<std::size_t>(plate)];
      if (!plane.present) continue;
      const Plane shape = plane_shape(plate);
      const double apart = shape.sign * (before(k, static_cast<std::size_t>(shape.axis)) - plane.position_at(step_)) - particles_.radius_of(static_cast<std::int32_t>(k));
      if (apart >= way(k) + planes_moved) continue;
      const auto batch = std::find_if(batches_.begin(), batches_.end(), [&](const Batch& b) { return k < static_cast<std::size_t>(b.first + b.count); });
      const PlateList& list = batch->plates[plate];
      if (std::find(list.particle.begin(), list.particle.begin() + list.used, static_cast<std::int32_t>(k)) == list.particle.begin() + list.used) return false;
    }
  }
  std::vector<char> has_some;  // of each batch: mostly few have
  for (const Batch& b : batches_) {
    const auto end = beyond.begin() + std::min(b.first + b.count, particles_.count);
    has_some.push_back(std::find(beyond.begin() + b.first, end, 1) != end);
  }
  std::vector<std::int32_t> owner;
  for (const Batch& b : batches_) {
    const auto concerned = [&](int number) { return has_some[static_cast<std::size_t>(number)] != 0; };
    if (!concerned(static_cast<int>(&b - batches_.data())) && std::none_of(b.partners.begin(), b.partners.end(), concerned)) continue;
    owner.resize(b.outer_j.size() + OwnedCounts::beyond);
    b.outer_owned.name_owners(b.first, owner.data());
    for (std::size_t m = 0; m < b.outer_j.size(); ++m) {
      if (b.listed[m / 64] >> (m % 64) & 1) continue;
      const auto i = static_cast<std::size_t>(owner[m]), j = static_cast<std::size_t>(b.outer_j[m]);
      if (!beyond[i] && !beyond[j]) continue;
      const double dx = domain_.nearest_x(before(i, 0) - before(j, 0)), dy = domain_.nearest_y(before(i, 1) - before(j, 1));
      const double apart = std::hypot(dx, dy, before(i, 2) - before(j, 2)) - particles_.radius_of(owner[m]) - particles_.radius_of(b.outer_j[m]);
      if (!(way(i) + way(j) <= apart)) return false;
    }
  }
  return true;
}

// Makes sure that the lists will hold for some steps, and says for how many: at most `wanted`.
int Simulation::prepare_lists(std::int64_t wanted) {
  const int n = static_cast<int>(std::min<std::int64_t>(wanted, engine_.unroll));
  mean_velocity();
  if (lists_valid_ && !lists_stale_)
    if (const int steps = look(n); steps >= std::min(n, worthwhile)) return steps;
  const AlignedArray<double> speeds = own_speeds();
  check_speeds(speeds);
  choose_horizon();
  if (lists_valid_ && choose_margins(false, speeds))
    prune_lists();
  else
    rebuild();
  lists_stale_ = false;
  return std::max(1, look(n));
}

void Simulation::prune_lists() {
  merge_all();
  const auto plates = plate_history(batches_, particles_);
  const ParallelFor run = on_workers();
  for (Saved::OfBatch& of : saved_->batches) of.history.release();  // nobody goes back behind a prune: lists come to lie where there is most room
  prune(batches_, particles_, domain_, inner_, keeps_k_t(), kernels_, run);
  list_plates(batches_, particles_, planes_, step_, inner_, plate_gap_, plates, run);
  start_from_here();
  listed_ = true;
  ++counters_.prunes;
}

void Simulation::rebuild() {
  *saved_ = {};  // nobody goes back behind a rebuild: meanwhile others may use the memory
  rebuild_with(pair_history(batches_, particles_, on_workers()));
}

void Simulation::rebuild_with(const PairHistories& pairs) {
  *saved_ = {};  // also where sides are taken away
  ChunkedArray<double> sums;
  const bool had_forces = !batches_.empty();
  if (had_forces) keep_sums(sums);
  rebuild_from(pairs, plate_history(batches_, particles_), had_forces ? &sums : nullptr);
}

// `even`: equal stretches of the curve are equal work.
int Simulation::batch_count(bool even) const {
  return engine_.batch > 0 ? batches_of(particles_.padded, engine_.batch) : automatic_batches(particles_.count, engine_.threads, even, engine_.cache);
}

void Simulation::cut_into_batches(const PairHistories& pairs, const std::int32_t* bucket, const Cuts& cuts) {
  const ParallelFor run = on_workers();
  batches_.clear();  // before the new ones are made: their memory serves again
  const Ownership ownership = engine_.fused ? Ownership::by_colour : Ownership::ahead;
  batches_ = make_batches(particles_, domain_, outer_, cuts, ownership, kernels_, run);
  fill_inner(batches_, particles_, domain_, inner_, keeps_k_t(), pairs, bucket, kernels_, run);
  const double bytes = touched_bytes_with_columns(batches_);
  asks_ahead_ = bytes > 0.5 * engine_.cache * engine_.threads;
  asks_history_ = bytes > 2.0 * engine_.cache;
}

// `sums`: forces by rank; null where there are none yet.
void Simulation::rebuild_from(const PairHistories& pairs, const std::vector<PlateHistory>& plates, const ChunkedArray<double>* sums) {
  const ParallelFor run = on_workers();
  // Several threads share the work of a bed in the cache; the batches of a larger one go where there is room [core/task_order.h].
  const bool shared = engine_.threads > 1 && particles_.count <= particles_in(engine_.cache);
  // Fused, two batches would take turns.
  const bool even = engine_.threads == 2 && !engine_.fused && (batches_.empty() || work_is_even(batches_, engine_.threads));
  const Cuts cuts = shared && !batches_.empty() ? cuts_of_equal_work(batches_, particles_.padded, batch_count(even)) : equal_cuts(particles_.padded, batch_count(even));
  const bool unknown = shared && (even || batches_.empty());
  const std::vector<std::int32_t> order = morton_order(particles_, 0, run);
  particles_.permute(order, run);
  const std::int32_t* const bucket = pairs.by_place ? order.data() : particles_.rank.data();
  choose_margins(true, own_speeds());
  for (auto& graph : graphs_) graph.reset();
  table_.reset();
  asks_.clear();
  cut_into_batches(pairs, bucket, cuts);
  // Nobody knew at first, and of two batches one may have the border to itself.
  if (unknown && !work_is_even(batches_, engine_.threads)) cut_into_batches(pairs, bucket, cuts_of_equal_work(batches_, particles_.padded, batch_count(false)));
  list_plates(batches_, particles_, planes_, step_, inner_, plate_gap_, plates, run);
  merged_.assign(batches_.size(), 1);
  if (sums != nullptr) put_sums(*sums);
  // The graph is as long as a usual run between two looks.
  unroll_ = engine_.unroll;
  prepare_table();
  prepare_graph();
  start_from_here();
  lists_valid_ = true;
  listed_ = true;
  ++counters_.rebuilds;
  counters_.batches = static_cast<int>(batches_.size());
}

void Simulation::rebuild_now() {
  const FloatMode mode;
  ensure_forces();
  rebuild();
}

void Simulation::take_sides_away() {
  domain_ = {};
  law_.width = law_.depth = law_.inverse_width = law_.inverse_depth = 0.0;
  motion_.width = motion_.depth = 0.0;
}

void Simulation::open_sides() {
  if (!periodic()) return;
  const FloatMode mode;
  ensure_forces();
  // Every centre is inside the box already; pairs that met through a face are apart from now on.
  FixedSum before(energy_unit_), after(energy_unit_);
  add_pair_energy(before);
  const PairHistories all = pair_history(batches_, particles_, on_workers());
  PairHistories kept;
  kept.by_place = all.by_place;
  kept.start.assign(1, 0);
  std::vector<PairHistory> left;
  const std::vector<std::int32_t> places = particles_.places();
  for (std::size_t bucket = 0; bucket + 1 < all.start.size(); ++bucket) {
    for (std::int32_t k = all.start[bucket]; k < all.start[bucket + 1]; ++k) {
      const PairHistory& h = all.pairs[static_cast<std::size_t>(k)];
      const auto a = static_cast<std::size_t>(places[static_cast<std::size_t>(h.low)]);
      const auto b = static_cast<std::size_t>(places[static_cast<std::size_t>(h.high)]);
      const double dx = particles_.x[a] - particles_.x[b], dy = particles_.y[a] - particles_.y[b];
      if (domain_.nearest_x(dx) == dx && domain_.nearest_y(dy) == dy) left.push_back(h);
    }
    kept.start.push_back(static_cast<std::int32_t>(left.size()));
  }
  kept.pairs.assign(left);
  take_sides_away();
  rebuild_with(kept);
  add_pair_energy(after);
  removed_ += before.value() - after.value();
  forces_valid_ = false;
}

// For the lists as they are now.
void Simulation::make_room_to_save() {
  Saved& s = *saved_;
  if (!moves_in_rows_)
    for (auto* column : {&s.x, &s.y, &s.z, &s.vx, &s.vy, &s.vz, &s.ux, &s.uy, &s.uz}) column->resize_to_overwrite(particles_.x.size());
  s.batches.resize(batches_.size());
  parallel(static_cast<int>(batches_.size()), [&](int k) {
    for_each_history(batches_[static_cast<std::size_t>(k)], [&](std::size_t size) { s.batches[static_cast<std::size_t>(k)].history.resize_to_overwrite(size); },
                     [](double*, std::size_t, std::size_t) {});
  });
  // What making lists has taken besides lies there unused for tens to hundreds of steps.
  if (listed_ && moves_in_rows_) trim_pool();
  listed_ = false;
}

namespace {
// Copies the batch's part of a column.
void copy_part(const Batch& b, const AlignedArray<double>& from, AlignedArray<double>& to) {
  std::copy_n(from.data() + b.first, b.count, to.data() + b.first);
}
}  // namespace

void Simulation::save_positions(const Batch& b) {
  Saved& s = *saved_;
  Particles& p = particles_;
  if (!moves_in_rows_) copy_part(b, p.x, s.x), copy_part(b, p.y, s.y), copy_part(b, p.z, s.z);
  p.keep_crossings(b.first, b.count);
}

void Simulation::save_velocities(const Batch& b) {
  Saved& s = *saved_;
  Particles& p = particles_;
  if (moves_in_rows_) {
    AlignedArray<double>* const columns[6] = {&p.vx, &p.vy, &p.vz, &p.ux, &p.uy, &p.uz};
    for (auto k = static_cast<std::size_t>(b.first); k < static_cast<std::size_t>(b.first + b.count); ++k)
      for (std::size_t m = 0; m < 6; ++m) (*columns[m])[k] = p.rows[row_size * k + 4 + m + m / 3];
  } else {
    copy_part(b, p.vx, s.vx), copy_part(b, p.vy, s.vy), copy_part(b, p.vz, s.vz);
    copy_part(b, p.ux, s.ux), copy_part(b, p.uy, s.uy), copy_part(b, p.uz, s.uz);
  }
  Saved::OfBatch& to = s.batches[static_cast<std::size_t>(&b - batches_.data())];
  to.rolling = b.rolling, to.out_of_range = b.out_of_range;
}

void Simulation::save_history(Batch& b) {
  Saved::OfBatch& to = saved_->batches[static_cast<std::size_t>(&b - batches_.data())];
  for_each_history(b, [](std::size_t) {}, [&](double* data, std::size_t size, std::size_t at) { to.history.put(at, data, size); });
  to.contacts = b.pair_totals.contacts;
}

void Simulation::restore() {
  Saved& s = *saved_;
  Particles& p = particles_;
  if (!moves_in_rows_) {
    p.x.swap(s.x), p.y.swap(s.y), p.z.swap(s.z);
    p.vx.swap(s.vx), p.vy.swap(s.vy), p.vz.swap(s.vz);
    p.ux.swap(s.ux), p.uy.swap(s.uy), p.uz.swap(s.uz);
  }
  std::fill(p.crossed.begin(), p.crossed.end(), std::int8_t{0});
  p.write_rows(on_workers());
  for (std::size_t k = 0; k < batches_.size(); ++k) {
    Batch& b = batches_[k];
    const Saved::OfBatch& from = s.batches[k];
    for_each_history(b, [](std::size_t) {},
                     [&](double* data, std::size_t size, std::size_t at) { from.history.get(at, data, size); });
    std::fill(b.sum.begin(), b.sum.end(), 0.0);
    merged_[k] = 1;
    b.pair_totals = {};
    b.pair_totals.contacts = from.contacts;
    std::fill(std::begin(b.plate_energy), std::end(b.plate_energy), 0);
    b.plate_work = b.rolling = 0;
    b.out_of_range = false;
    rolling_ += from.rolling;
    kicked_out_of_range_ = kicked_out_of_range_ || from.out_of_range;
  }
  kicked_ = true;
}

}  // namespace platen
