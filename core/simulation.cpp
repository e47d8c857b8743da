// Setting up and stepping; lists are in simulation_lists.cpp, measurements in simulation_measures.cpp.
#include "core/simulation.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "core/float_mode.h"
#include "core/law_constants.h"
#include "core/simulation_detail.h"
#include "core/task_order.h"

namespace platen {

namespace {
// By the last pass, which may have had the list before a prune; none after a rebuild. Whether pairs are passed over changes no bit.
bool is_dense(const Batch& b) { return 4 * b.pair_totals.contacts > 3 * std::int64_t{b.padded}; }
}  // namespace

Simulation::Workers::Workers(int threads)
    : control(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads)), arena(threads) {}

Simulation::Simulation(SimulationSetup setup)
    : pair_(setup.pair),
      plate_parameters_(setup.plate),
      engine_(setup.engine),
      width_(setup.width),
      depth_(setup.depth),
      gravity_(setup.gravity),
      saved_(std::make_unique<Saved>()) {
  const FloatMode mode;
  engine_.unroll = std::clamp(engine_.unroll, 1, most_steps_of_run);
  if (setup.periodic) domain_ = {setup.width, setup.depth};
  setup_particles(setup.spheres);
  setup_laws(setup);
  if (engine_.executor == Executor::automatic)
    engine_.executor = engine_.threads > 1 ? Executor::flow_graph : Executor::serial;
  if (engine_.executor == Executor::flow_graph) workers_ = std::make_unique<Workers>(engine_.threads);
}

Simulation::~Simulation() {
  // The graph belongs to the arena that it was built in.
  for (auto& graph : graphs_) graph.reset();
}

void Simulation::setup_particles(const SphereTable& table) {
  const std::size_t n = table.id.size();
  std::vector<std::size_t> order(n);  // by id
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return table.id[a] < table.id[b]; });
  bool equal = true;
  for (std::size_t k = 1; k < n; ++k)
    equal = equal && table.radius[k] == table.radius[0] && table.density[k] == table.density[0];
  const bool wide = engine_.scene >= 0 && !built_scenes[static_cast<std::size_t>(engine_.scene)].traits.equal_spheres;
  const Exponent exponent = pair_.exponent == 1.0 ? Exponent::one : pair_.exponent == 1.5 ? Exponent::three_halves : Exponent::any;
  SceneTraits needed;
  needed.exponent = exponent;
  needed.adhesion = pair_.k_adh > 0.0 || pair_.f0 != 0.0;
  needed.plasticity = pair_.k2 > pair_.k1;
  needed.rolling = pair_.rolling_friction == 0.0                      ? Rolling::none
                   : pair_.rolling_model == RollingModel::absolute ? Rolling::absolute
                                                                   : Rolling::relative;
  needed.equal_spheres = equal && !wide;
  needed.energy = engine_.energy;
  KernelRequest request;
  request.needed = needed;
  request.rolling = needed.rolling == Rolling::absolute || plate_parameters_.rolling_friction > 0.0;
  request.reproducible = engine_.reproducible;
  request.scene = engine_.scene;
  kernels_ = choose_kernels(engine_.instruction_set, request);
  // A scene for unequal spheres reads columns, even where they are all the same.
  const bool columns = !built_scenes[static_cast<std::size_t>(kernels_.scene)].traits.equal_spheres;

  particles_.resize(static_cast<std::int32_t>(n), !columns);
  std::vector<std::int64_t> ids(n);
  largest_radius_ = 0.0;
  smallest_radius_ = smallest_mass_ = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t from = order[k];
    const double R = table.radius[from], m = sphere_mass(R, table.density[from]);
    largest_radius_ = std::max(largest_radius_, R);
    smallest_radius_ = std::min(smallest_radius_, R);
    smallest_mass_ = std::min(smallest_mass_, m);
    ids[k] = table.id[from];
    particles_.rank[k] = static_cast<std::int32_t>(k);
    double x = table.position[3 * from], y = table.position[3 * from + 1];
    if (domain_.width > 0.0) {  // a caller may pass unwrapped positions
      const auto wrap = [&](double& c, double length, std::size_t axis) {
        const double boxes = std::floor(c / length);
        std::int32_t& image = particles_.image[2 * k + axis];
        image = static_cast<std::int32_t>(boxes);
        c -= boxes * length;
        if (c >= length) c = 0.0, ++image;  // a little below a side: rounded onto the one opposite
      };
      wrap(x, domain_.width, 0), wrap(y, domain_.depth, 1);
    }
    particles_.x[k] = x, particles_.y[k] = y, particles_.z[k] = table.position[3 * from + 2];
    if (!table.velocity.empty())
      particles_.vx[k] = table.velocity[3 * from], particles_.vy[k] = table.velocity[3 * from + 1],
      particles_.vz[k] = table.velocity[3 * from + 2];
    if (!table.spin.empty())
      particles_.ux[k] = R * table.spin[3 * from], particles_.uy[k] = R * table.spin[3 * from + 1],
      particles_.uz[k] = R * table.spin[3 * from + 2];
    if (columns) {
      particles_.radius[k] = R, particles_.inverse_radius[k] = 1.0 / R;
      particles_.mass[k] = m, particles_.inverse_mass[k] = 1.0 / m;
    }
    particles_.common_radius = R, particles_.common_mass = m;
  }
  particles_.id_of_rank = Ids(std::move(ids));
  for (std::int32_t k = 0; k < particles_.count; ++k) {
    const double R = table.radius[order[static_cast<std::size_t>(k)]];
    solid_volume_ += sphere_mass(R, 1.0);
  }
  particles_.write_rows();
}

void Simulation::setup_laws(const SimulationSetup& setup) {
  const double R = largest_radius_, m = particles_.common_mass, n = pair_.exponent;
  const double heaviest = [&] {
    double largest = m;
    for (std::int32_t k = 0; k < particles_.count; ++k) largest = std::max(largest, particles_.mass_of(k));
    return largest;
  }();
  LawConstants& c = law_;
  c = pair_constants(pair_);
  c.beta_n = std::sqrt(c.damping * ((m * m) / (m + m)) * c.k1);
  c.overlap_floor = n < 1.0 ? 1e-3 * smallest_radius_ : 0.0;
  c.radius = particles_.common_radius, c.inverse_radius = 1.0 / particles_.common_radius;
  c.width = domain_.width, c.depth = domain_.depth;
  c.inverse_width = c.width > 0.0 ? 1.0 / c.width : 0.0;
  c.inverse_depth = c.depth > 0.0 ? 1.0 / c.depth : 0.0;

  // Most contacts of a sphere, a power of two from the size ratio: 3.6 (1 + ratio)^2 touch a large one.
  const double ratio = largest_radius_ / smallest_radius_;
  const double most = ratio == 1.0 ? 16.0 : power_of_two_above(3.6 * (1.0 + ratio) * (1.0 + ratio));
  c.rolling_share = 2.0 / most;

  // The largest credible contribution of a pair: the steepest branch at an overlap of R/2 plus damping at the speed
  // R omega. Every factor scales exactly under a similarity with powers of two.
  const double deep = 0.5 * R, s = std::pow(deep, n), slope = n * c.k2 * std::pow(deep, n - 1.0);
  const double fastest = R * std::sqrt(slope / heaviest);
  const double beta = std::sqrt(c.damping * (0.5 * heaviest) * (n * c.k1 * std::pow(deep, n - 1.0)));
  const double F = power_of_two_above(std::max(c.k2, c.k_adh) * s + std::fabs(c.f0) + beta * fastest);
  c.force = {1.5 * 0x1p52 * (F * most * 0x1p-53), F, 1.0 / (F * most * 0x1p-53)};
  most_push_ = 0.25 * F * most;
  motion_.strongest2 = most_push_ * most_push_;
  const double E = power_of_two_above(F * R), q = E * chunk_size * 0x1p-53;
  c.energy = {1.5 * 0x1p52 * q, E, 1.0 / q};
  // Forces are compared with F where overlaps are above R/2, a lever of 3/4. At smaller ones springs give less than 2.3 F,
  // which sums still hold exactly, unless friction is above 1 or dashpots are stiffest at the smallest overlaps.
  c.watched_lever = c.mu > 1.0 || n < 1.0 ? 2.0 : 0.75;
  energy_unit_ = E * 0x1p-60;

  PlateConstants& p = plate_law_;
  p = plate_constants(plate_parameters_);
  const double plate_slope = p.stiffness_n * std::sqrt(R * deep);
  const double plate_speed = R * std::sqrt(plate_slope / heaviest);
  const double F_p = power_of_two_above(p.hertz * std::sqrt(R * deep) * deep +
                                        std::sqrt(p.damping * heaviest * plate_slope) * plate_speed);
  p.force = {0.0, F_p, 0.0};
  p.energy = c.energy;
  p.energy.bound = power_of_two_above(F_p * R);
  plate_force_unit_ = F_p * 0x1p-60;

  motion_.gravity = setup.gravity;
  motion_.mu_r = pair_.rolling_model == RollingModel::absolute ? pair_.rolling_friction : 0.0;
  motion_.mass = particles_.common_mass, motion_.inverse_mass = 1.0 / particles_.common_mass;
  motion_.radius = particles_.common_radius, motion_.inverse_radius = 1.0 / particles_.common_radius;
  motion_.width = domain_.width, motion_.depth = domain_.depth;
  motion_.energy = c.energy;
}

bool Simulation::confined() const {
  const auto present = [this](int plate) { return planes_[static_cast<std::size_t>(plate)].present; };
  return periodic() || (present(wall_x_low) && present(wall_x_high) && present(wall_y_low) && present(wall_y_high));
}

double Simulation::time() const { return time_base_ + static_cast<double>(step_ - step_base_) * dt_; }

void Simulation::set_time_step(double dt) {
  if (dt == dt_) return;
  time_base_ = time(), step_base_ = step_;
  for (PlaneMotion& plane : planes_) {
    if (!plane.present) continue;
    const double elapsed = static_cast<double>(step_ - plane.start) * plane.dt;
    plane.origin += plane.velocity * elapsed;
    plane.vibrated += elapsed;
    plane.start = step_, plane.dt = dt;
  }
  dt_ = dt;
}

void Simulation::set_plane(int plate, PlaneMotion motion) {
  motion.present = true, motion.start = step_, motion.dt = dt_;
  planes_[static_cast<std::size_t>(plate)] = motion;
  lists_valid_ = false, forces_valid_ = false;
}

void Simulation::set_plane_velocity(int plate, double velocity) {
  PlaneMotion& plane = planes_[static_cast<std::size_t>(plate)];
  plane.origin = plane.position_at(step_);
  plane.amplitude = 0.0;
  plane.velocity = velocity, plane.start = step_, plane.dt = dt_;
}

void Simulation::remove_plane(int plate) {
  FixedSum stored(energy_unit_);
  for (Batch& batch : batches_) {
    PlateList& list = batch.plates[plate];
    add_plate_energy(list, plate_law_, stored, particles_);
    // Its springs go with it: a plane that is set again at once would take them over.
    for (auto* column : {&list.xi_x, &list.xi_y, &list.xi_z, &list.stiffness_last}) std::fill(column->begin(), column->end(), 0.0);
  }
  removed_ += stored.value();
  planes_[static_cast<std::size_t>(plate)].present = false;
  lists_valid_ = false, forces_valid_ = false;
}

double Simulation::plane_position(int plate) const { return planes_[static_cast<std::size_t>(plate)].position_at(step_); }

void Simulation::parallel(int count, const std::function<void(int)>& body) {
  const auto one = [&](int k) {
    const FloatMode mode;
    body(k);
  };
  if (!workers_ || count < 2) {
    for (int k = 0; k < count; ++k) one(k);
    return;
  }
  workers_->arena.execute([&] { tbb::parallel_for(0, count, [&](int k) { one(k); }); });
}

// Adds the halo slots of other batches and the plates' forces to the sums of a batch. Pair sums are exact in any order;
// plates are added to the finished sum in the order of planes.
void Simulation::merge(Batch& b) {
  for (const Incoming& in : b.incoming) {
    const Batch& from = batches_[static_cast<std::size_t>(in.batch)];
    const auto slot = static_cast<std::size_t>(in.slot);
    kernels_.merge({b.sum.data(), from.sum.data() + record_size * (static_cast<std::size_t>(from.count) + slot), from.halo.data() + slot, b.first, in.count});
  }
  for (const PlateList& list : b.plates) {
    for (std::size_t m = 0; m < static_cast<std::size_t>(list.used); ++m) {
      if (!(list.overlap[m] > 0.0)) continue;
      double* sum = b.sum.data() + record_size * static_cast<std::size_t>(list.particle[m] - b.first);
      const double* record = list.records.data() + record_size * m;
      for (int k = 0; k < record_size; ++k) sum[k] += record[k];
    }
  }
}

// Kick and drift. The sums of the batch's particles are zero afterwards, for the next contacts. `saves`: for going back to
// [simulation_detail.h, Saved].
void Simulation::integrate(Batch& b, const MotionConstants& c, bool saves) {
  const auto index = static_cast<std::size_t>(&b - batches_.data());
  if (!merged_[index]) merge(b);
  if (saves) save_positions(b);
  Particles& p = particles_;
  const auto first = static_cast<std::size_t>(b.first);
  const auto column = [&](AlignedArray<double>& a) { return a.empty() ? nullptr : a.data() + first; };
  const auto state = [&](AlignedArray<double>& a) { return moves_in_rows_ ? nullptr : a.data() + first; };
  const MotionBatch batch{state(p.x), state(p.y), state(p.z), state(p.vx), state(p.vy), state(p.vz), state(p.ux),
                          state(p.uy), state(p.uz), column(p.inverse_mass), column(p.mass), column(p.radius),
                          column(p.inverse_radius), p.rows.data() + row_size * first, p.crossed.data() + 2 * first,
                          b.sum.data(), true, speed2_.data() + first, b.count, asks_ahead_};
  MotionTotals totals;
  kernels_.motion(batch, c, totals);
  // The places that fill up the last vector rest where they are.
  const auto filled = static_cast<std::size_t>(std::max(b.first, p.count)), end = first + static_cast<std::size_t>(b.count);
  for (auto k = filled; k < end; ++k) {
    for (auto* a : {&p.x, &p.y, &p.z, &p.vx, &p.vy, &p.vz, &p.ux, &p.uy, &p.uz}) (*a)[k] = 0.0;
    for (const std::size_t part : {0, 4, 8}) std::fill_n(p.rows.data() + row_size * k + part, 3, 0.0);
    p.crossed[2 * k] = p.crossed[2 * k + 1] = 0;
  }
  b.fastest = std::sqrt(totals.fastest2);
  b.rolling += totals.rolling;
  b.out_of_range = b.out_of_range || totals.out_of_range;
  // Pairs far faster than R omega give more than sums hold exactly before they overlap deeply: it shows in a sphere's sum, which
  // is left for that.
  if (!(totals.strongest < c.strongest2)) {
    b.out_of_range = b.out_of_range || !pairs_within(b, most_push_);
    std::memset(b.sum.data(), 0, static_cast<std::size_t>(b.count) * record_size * sizeof(double));
  }
  if (saves) save_velocities(b);
}

// Whether pairs push every sphere of a batch with less than `most` [N]; plates and walls may push harder. Only spheres that
// are pushed that hard altogether are looked at, so that what else the batch holds does not matter.
bool Simulation::pairs_within(const Batch& b, double most) const {
  AlignedArray<double> by_plates;
  by_plates.assign(3 * static_cast<std::size_t>(b.count), 0.0);
  for (const PlateList& list : b.plates)
    for (std::size_t m = 0; m < static_cast<std::size_t>(list.used); ++m)
      if (list.overlap[m] > 0.0)
        for (std::size_t axis = 0; axis < 3; ++axis)
          by_plates[3 * static_cast<std::size_t>(list.particle[m] - b.first) + axis] += list.records[record_size * m + axis];
  for (std::size_t k = 0; k < static_cast<std::size_t>(b.count); ++k) {
    double size2 = 0.0, all2 = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double all = b.sum[record_size * k + axis], f = all - by_plates[3 * k + axis];
      size2 += f * f, all2 += all * all;
    }
    if (!(all2 < most * most) && !(size2 < most * most)) return false;
  }
  return true;
}

// Bound of the change of the distance of any pair of a batch in its last step [m]; with what rounding adds, of speeds and of
// places up to 1e5 R from the origin.
double Simulation::leap_of(const Batch& b, double dt) const {
  double fastest = b.fastest;
  for (const int partner : b.partners) fastest = std::max(fastest, batches_[static_cast<std::size_t>(partner)].fastest);
  return (1.0 + 1e-9) * (b.fastest + fastest) * dt + 1e-9 * largest_radius_;
}

namespace {
// For columns of a batch's spheres [kernels/staged_owners.h].
double* stage_of_this_thread(std::int32_t spheres) {
  static thread_local AlignedArray<double> stage;
  stage.reserve(static_cast<std::size_t>(9 * stage_column(spheres)));
  return stage.data();
}
}  // namespace

// `cleared`: the sums of the batch's particles are zero already.
void Simulation::contacts(Batch& b, std::int64_t step, const LawConstants& law, const PlateConstants& plate_law, bool cleared,
                          const StretchesOfLines* asked) {
  merged_[static_cast<std::size_t>(&b - batches_.data())] = 0;
  const std::size_t from = cleared ? static_cast<std::size_t>(b.count) * record_size : 0;
  std::memset(b.sum.data() + from, 0, (b.sum.size() - from) * sizeof(double));
  const double leap = leap_of(b, law.dt);
  const auto nothing = static_cast<std::int32_t>(b.sum.size() * sizeof(double)) - record_bytes;
  const bool dense = is_dense(b);
  const auto state = [&](const AlignedArray<double>& a) { return moves_in_rows_ ? nullptr : a.data() + b.first; };
  PairBatch pairs{particles_.rows.data(), particles_.rows.data() + row_size * static_cast<std::int64_t>(b.first), b.row_j.data(), b.to.data(), b.owners_of_eight.data(), b.sp.data(), b.tx.data(),
                  b.ty.data(), b.tz.data(), b.k_t_last.empty() ? nullptr : b.k_t_last.data(), b.sum.data(), b.first, b.padded, b.first + b.count, nothing, dense, leap,
                  state(particles_.x), state(particles_.y), state(particles_.z), state(particles_.vx), state(particles_.vy), state(particles_.vz), state(particles_.ux),
                  state(particles_.uy), state(particles_.uz), moves_in_rows_ && kernels_.stages ? stage_of_this_thread(b.count) : nullptr, dense && asks_for_partners() ? b.ahead : 0, particles_.padded, asks_history_, nullptr, 0, 0};
  if (asked != nullptr) asked->put_into(pairs);
  b.pair_totals.contacts = 0;
  kernels_.contacts(pairs, law, b.pair_totals);
  b.out_of_range = b.out_of_range || b.pair_totals.out_of_range;
  for (int plate = 0; plate < plate_count; ++plate) {
    PlateList& list = b.plates[plate];
    if (list.used == 0) continue;
    Plane plane = plane_shape(plate);
    plane.position = planes_[static_cast<std::size_t>(plate)].position_at(step);
    plane.velocity = planes_[static_cast<std::size_t>(plate)].velocity_at(step);
    const PlateBatch batch{particles_.rows.data(), list.particle.data(), list.xi_x.data(), list.xi_y.data(),
                           list.xi_z.data(), list.stiffness_last.data(), list.records.data(), list.overlap.data(),
                           list.padded, list.used};
    PlateTotals totals;
    kernels_.plates(batch, plane, plate_law, totals);
    for (int term = 0; term < term_count; ++term) b.plate_energy[term] += totals.energy[term];
    b.plate_work += totals.work;
    b.out_of_range = b.out_of_range || totals.out_of_range;
  }
}

void Simulation::run_task(const Task& task) {
  const FloatMode mode;
  Batch& b = batches_[static_cast<std::size_t>(task.batch)];
  const bool first = task.offset == 0;
  if (task.kind != TaskKind::contacts) integrate(b, first ? first_motion_ : motion_, first);
  if (task.kind == TaskKind::integrate) return;
  if (first) save_history(b);
  const auto pass = [&](const StretchesOfLines* asked) { contacts(b, step_ + task.offset + 1, law_, plate_law_, true, asked); };
  if (asks_.empty() || asks_[static_cast<std::size_t>(task.number)].empty()) return pass(nullptr);
  const StretchesOfLines asked = lines_of(asks_[static_cast<std::size_t>(task.number)]);
  pass(&asked);
}

StretchesOfLines Simulation::lines_of(const std::vector<Asked>& asks) const {
  StretchesOfLines lines;
  const Particles& p = particles_;
  for (const Asked& a : asks) {
    if (a.offset >= steps_of_run_) continue;
    const Batch& b = batches_[static_cast<std::size_t>(a.batch)];
    const auto first = static_cast<std::size_t>(b.first), count = static_cast<std::size_t>(b.count), listed = static_cast<std::size_t>(b.padded);
    const auto add = [&](const auto* array, std::size_t size) { lines.add(array, size, a.from, a.to); };
    if (a.contacts) {
      if (built_scenes[static_cast<std::size_t>(kernels_.scene)].traits.plasticity) add(b.sp.data(), listed);
      for (const auto* column : {&b.tx, &b.ty, &b.tz, &b.k_t_last})
        if (!column->empty()) add(column->data(), listed);
      add(b.row_j.data(), listed), add(b.to.data(), listed), add(b.owners_of_eight.data(), listed / 8);
      continue;
    }
    // Only large beds ask, and those move in rows.
    for (const auto* column : {&p.radius, &p.inverse_radius, &p.mass, &p.inverse_mass})
      if (!column->empty()) add(column->data() + first, count);
    add(speed2_.data() + first, count);
    add(p.rows.data() + row_size * first, row_size * count);
    add(b.sum.data(), record_size * count);
    for (const Incoming& in : b.incoming) {
      const Batch& owner = batches_[static_cast<std::size_t>(in.batch)];
      add(owner.sum.data() + record_size * static_cast<std::size_t>(owner.count + in.slot), record_size * static_cast<std::size_t>(in.count));
    }
  }
  return lines;
}

// Forces at the present step without advancing springs: after something other than motion changed.
void Simulation::ensure_forces() {
  if (!lists_valid_) rebuild();
  if (forces_valid_) return;
  const FloatMode mode;
  law_.dt = plate_law_.dt = 0.0;
  parallel(static_cast<int>(batches_.size()), [&](int k) { contacts(batches_[static_cast<std::size_t>(k)], step_, law_, plate_law_, false); });
  collect();
  forces_valid_ = true;
  bool bad = false;
  for (const Batch& b : batches_) bad = bad || b.out_of_range;
  if (bad) fail("forces out of range");
}

void Simulation::collect() {
  contacts_ = 0;
  for (Batch& b : batches_) {
    contacts_ += b.pair_totals.contacts;
    for (int term = 0; term < term_count; ++term) {
      dissipated_[term] += b.pair_totals.energy[term] + b.plate_energy[term];
      b.pair_totals.energy[term] = b.plate_energy[term] = 0;
    }
    rolling_ += b.rolling;
    plate_work_ += b.plate_work;
    b.rolling = b.plate_work = 0;
  }
}

void Simulation::run_chunk(int steps) {
  steps_of_run_ = steps;
  law_.dt = plate_law_.dt = dt_;
  motion_.kick = motion_.drift = dt_;
  motion_.mean_x = mean_[0], motion_.mean_y = mean_[1], motion_.mean_z = mean_[2];
  first_motion_ = motion_;
  first_motion_.kick = 0.5 * (last_drift_ + dt_);
  // What is added then, -0.0 times 0.0, changes no velocity, not even one of -0.0.
  if (kicked_) first_motion_.kick = -0.0, first_motion_.gravity = 0.0;
  const TaskBody body = [this](const Task& task) { run_task(task); };
  ++counters_.runs;
  if (asks_for_partners()) ++counters_.runs_asking;
  const auto start = std::chrono::steady_clock::now();
  switch (engine_.executor) {
    case Executor::flow_graph: workers_->arena.execute([&] { run_graph(steps); }); break;
    case Executor::plain_threads: run_on_plain_threads(*table_, steps, body, engine_.threads); break;
    default: run_serially(*table_, steps, body); break;
  }
  if (4 * steps < unroll_) return;  // most of the time would be that of beginning
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / steps;
  if (takers_are_tried_) taking_.took(seconds);
  // Only dense lists ask: in other runs both ways are the same.
  if (asks_are_tried() && std::any_of(batches_.begin(), batches_.end(), is_dense)) asking_.took(seconds);
}

// A bed that the third cache holds is quicker without asking where that cache is its own, and much slower where others crowd it out.
// Not together with the takers: each trial would see what the other changes.
bool Simulation::asks_are_tried() const { return asks_ahead_ && !asks_history_ && !takers_are_tried_; }

bool Simulation::asks_for_partners() const { return asks_ahead_ && !(asks_are_tried() && asking_.way() == 1); }

void Simulation::prepare_table() {
  table_ = std::make_unique<TaskTable>(batches_, unroll_, engine_.fused);
  const bool in_graph = engine_.executor == Executor::flow_graph, alone = engine_.threads == 1 || engine_.executor == Executor::serial;
  const double cache = order_if_large(*table_, batches_, engine_.cache, in_graph ? engine_.threads : 1, on_workers());
  moves_in_rows_ = cache > 0.0;
  // A worker asks for what it will itself take next; where anybody may take a task nobody knows who that is.
  if (cache > 0.0 && (alone || !table_->worker().empty())) asks_ = asks_of_tasks(*table_, batches_, asked_beyond * cache);
  // Batches of a few spheres, which only a case file asks for, would make long tables of who waits for whom.
  const auto threads = static_cast<std::size_t>(engine_.threads);
  takers_are_tried_ = cache == 0.0 && in_graph && threads > 2 && batches_.size() >= threads && batches_.size() <= 64 * threads;
  if (takers_are_tried_) deal_out(*table_, batches_, engine_.threads);
  if (engine_.tamper) engine_.tamper(*table_);
}

// Who takes the tasks of the next run. A bed in the caches: threads that keep their part of it are the fastest where each has a core to
// itself, and the slowest where something else holds one of them up.
Takers Simulation::takers() const {
  if (takers_are_tried_) return static_cast<Takers>(taking_.way());
  return table_->worker().empty() ? Takers::anybody : Takers::workers;
}

void Simulation::prepare_graph() {
  std::unique_ptr<FlowGraph>& graph = graphs_[static_cast<std::size_t>(takers())];
  if (graph || engine_.executor != Executor::flow_graph) return;
  workers_->arena.execute([&] { graph = std::make_unique<FlowGraph>(*table_, [this](const Task& task) { run_task(task); }, takers()); });
}

void Simulation::run_graph(int steps) {
  const Takers by = takers();
  graphs_[static_cast<std::size_t>(by)]->run(steps);
  if (by == Takers::workers) ++counters_.runs_by_workers;
}

void Simulation::advance(std::int64_t steps) {
  const FloatMode mode;
  ensure_forces();
  bool one_by_one = false;
  std::int64_t at_most = engine_.unroll;
  while (steps > 0) {
    const int n = prepare_lists(std::min<std::int64_t>(steps, one_by_one ? 1 : at_most));
    prepare_graph();
    make_room_to_save();
    run_chunk(n);
    bool bad = kicked_out_of_range_;
    for (const Batch& b : batches_) bad = bad || b.out_of_range;
    // Did the lists hold? If not, a pair may have been missed, and a force out of range may be its consequence: from the
    // saved state once more with wider lists. Lists change no bits, so nobody sees it.
    const Ways ways = look_back(n);
    if (ways == Ways::too_long) {
      double fastest = 0.0;
      for (std::size_t k = 0; k < static_cast<std::size_t>(particles_.count); ++k) {
        const double* v = particles_.rows.data() + row_size * k + 4;
        fastest = std::max(fastest, std::hypot(v[0] - mean_[0], v[1] - mean_[1], v[2] - mean_[2]));
      }
      const bool known = std::isfinite(fastest);
      restore();
      counters_.redone_steps += n;
      at_most = std::max(1, n / 2);
      kick_factor_ = std::min(8.0, 1.5 * kick_factor_);
      redo_margin_ = std::max({2.0 * redo_margin_, 1.25 * (known ? fastest : 0.0) * dt_ * at_most, 0.01 * largest_radius_});
      lists_stale_ = true;
      if (n > 1 || redo_margin_ < 4.0 * widest_margin()) continue;
      step_ += n;
      fail("a sphere moves farther in one step than lists can follow; use a smaller time step");
    }
    at_most = engine_.unroll;
    redo_margin_ = 0.0;
    if (bad || ways == Ways::no_number) {
      if (n > 1) {  // once more step by step, so that the message tells where it began
        restore();
        one_by_one = true;
        continue;
      }
      step_ += n;
      if (moves_in_rows_) settle();  // the message tells of spheres as they are now
      fail("forces or velocities out of range");
    }
    collect();
    kicked_ = false;
    step_ += n;
    steps -= n;
    last_drift_ = dt_;
    for (int axis = 0; axis < 3; ++axis) drift_since_look_[axis] = mean_[axis] * (n * dt_);
    plane_moved_ += plane_path(n);
    if (moves_in_rows_) settle();
    moved_since_look_ = !moves_in_rows_;
  }
}

}  // namespace platen
