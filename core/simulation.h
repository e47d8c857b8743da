// A bed of spheres between planes, advanced step by step. The library behind the experiment: it knows nothing of case
// files, stages or output.
//
// The state is always that right after the forces of step n were found: positions at n, velocities at n - 1/2, history
// and forces at n. One step is then: kick and drift to n + 1 (integrate), forces at n + 1 (contacts).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/asked_lines.h"
#include "core/batches.h"
#include "core/contacts.h"
#include "core/fixed_sum.h"
#include "core/flow_graph.h"
#include "core/measures.h"
#include "core/neighbours.h"
#include "core/particles.h"
#include "core/plates.h"
#include "core/quicker.h"
#include "core/stability.h"
#include "core/step_graph.h"
#include "core/task_asks.h"
#include "core/task_order.h"
#include "core/third_cache.h"
#include "kernels/kernel_table.h"
#include "kernels/law_parameters.h"

namespace platen {

// A run that cannot go on: not a number, overlap above R, force out of range, lost particle. Names step, ids, positions. Of the Simulation
// that threw it only step(), time() and counters() mean anything from then on.
class RunError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct SphereTable {
  std::vector<std::int64_t> id;    // unique
  std::vector<double> position;    // N x 3 [m]
  std::vector<double> velocity;    // N x 3 [m/s] at the start; may be empty: at rest
  std::vector<double> spin;        // N x 3 [rad/s]; may be empty
  std::vector<double> radius;      // N [m]
  std::vector<double> density;     // N [kg/m3]
};

enum class Executor { automatic, serial, flow_graph, plain_threads };

struct EngineOptions {
  double skin = 0.0;        // [m]; 0 = chosen
  double inner_gap = 0.0;   // [m]; 0 = chosen
  int batch = 0;            // particles; 0 = chosen
  int threads = 1;
  int unroll = 32;          // most steps between two looks at the lists, up to most_steps_of_run
  bool reproducible = false;
  bool energy = true;
  int scene = -1;           // a built scene by number; -1: the cheapest that covers the case
  InstructionSet instruction_set = InstructionSet::scalar;
  Executor executor = Executor::automatic;
  bool fused = false;       // one task per batch and step instead of two
  double cache = ordered_cache();  // that cuts and orders of tasks count on in larger beds; a worker whose part is above half of it asks ahead, up to twice as much if that is quicker [bytes]
  std::function<void(TaskTable&)> tamper;  // for tests: changes every table of tasks before it is used
};

struct SimulationSetup {
  PairLaw pair;
  PlateLaw plate;
  SphereTable spheres;
  double gravity = 9.81;    // along -z [m/s2]
  double width = 0.0, depth = 0.0;  // of the box [m]; 0 where there is none
  bool periodic = false;
  EngineOptions engine;
};

struct SimulationState;  // core/simulation_state.h

struct EngineCounters {
  std::int64_t rebuilds = 0, prunes = 0, redone_steps = 0;
  std::int64_t spared_steps = 0;  // not done again although spheres went beyond their margins
  std::int64_t runs = 0, runs_asking = 0;  // of steps; those in which partners were asked for ahead [kernels/ask_ahead.h]
  std::int64_t runs_by_workers = 0;  // of steps, in which threads kept their parts of the bed [core/flow_graph.h]
  int batches = 0;
  double skin = 0.0, gap = 0.0;  // of the lists, means over the spheres [m]
  std::int64_t bytes = 0;   // of the large arrays
};

class Simulation {
 public:
  explicit Simulation(SimulationSetup setup);
  ~Simulation();

  std::int64_t step() const { return step_; }
  double time() const;
  double time_step() const { return dt_; }
  void set_time_step(double dt);

  // Planes. Moving a plane starts at the present step; planes that carry contacts keep them.
  void set_plane(int plate, PlaneMotion motion);
  void remove_plane(int plate);
  void set_plane_velocity(int plate, double velocity);  // from the next step on; ends a vibration
  const PlaneMotion& plane(int plate) const { return planes_[static_cast<std::size_t>(plate)]; }
  double plane_position(int plate) const;

  // Takes the periodic sides away: pairs across a face are deleted, every sphere stays where it is [A32].
  void open_sides();
  bool periodic() const { return domain_.width > 0.0; }
  // Whether sides, periodic ones or walls, keep the bed in its box, so that area times height is its volume.
  bool confined() const;

  void advance(std::int64_t steps);

  // Everything, or without what costs a pass over all pairs: the stored energies and the residual.
  Measures measure(bool stored_energies = true);
  // stress on top and bottom alone [Pa]; cheaper than measure().
  double stress(int plate);
  Snapshot snapshot(bool with_contacts = true);
  // XXH3 over positions, half-step velocities, u, images in id order, then touching contacts sorted by ids with their
  // history, then `extra` (the state of the stage).
  std::uint64_t state_hash(const std::string& extra = {});
  // Limits of the time step from the present contact network; undamped and damped.
  StepLimits step_limits() { return limits_of_network(nullptr); }
  // The same, and which contact holds most of the fastest mode: "spheres 3 and 8", "sphere 5 and the top plate"; costs
  // up to twice as much.
  StepLimits step_limits(std::string& ruled_by) { return limits_of_network(&ruled_by); }

  // Energy of what is there now counts as inserted: called once when filling is done.
  void count_inserted();

  // The outlet of a rain: spheres whose centre is above z [m] and that fall straight down, with `speed` [m/s] or faster and
  // without turning, go on with `speed`. What this changes of their energy counts as inserted. How many they are.
  std::int64_t carry_down(double z, double speed);

  std::int32_t particles() const { return particles_.count; }
  double mean_radius() const;
  double area() const { return width_ * depth_; }
  const KernelTable& kernels() const { return kernels_; }
  const EngineCounters& counters() const { return counters_; }
  double largest_radius() const { return largest_radius_; }
  double smallest_radius() const { return smallest_radius_; }
  double smallest_mass() const { return smallest_mass_; }

  // Everything that is needed to go on with the same bits, and going on from it: on a Simulation that was set up with the same
  // laws, ids, radii and densities and has made no step. Throws std::invalid_argument for a state of other spheres.
  SimulationState whole_state();
  void take_up(const SimulationState& state);

  // For tests and benches: the lists and tasks as they are.
  const std::vector<Batch>& batches() const { return batches_; }
  const Particles& state() const { return particles_; }
  const TaskAsks& asks() const { return asks_; }
  StretchesOfLines lines_of(const std::vector<Asked>& asks) const;  // of those that a run of steps will need, where they lie
  const LawConstants& law() const { return law_; }
  const PlateConstants& plate_law() const { return plate_law_; }
  void rebuild_now();
  void ensure_forces();
  double leap_of(const Batch& batch, double dt) const;  // [m], bound of what a pair's distance changes in the last step

 private:
  struct Saved;
  StepLimits limits_of_network(std::string* ruled_by);
  void setup_particles(const SphereTable& spheres);
  void setup_laws(const SimulationSetup& setup);
  void merge(Batch& batch);
  void integrate(Batch& batch, const MotionConstants& c, bool saves);
  bool pairs_within(const Batch& batch, double most) const;
  void contacts(Batch& batch, std::int64_t step, const LawConstants& law, const PlateConstants& plate_law, bool cleared,
                const StretchesOfLines* asked = nullptr);
  void run_task(const Task& task);
  void collect();
  void rebuild();
  void rebuild_with(const PairHistories& pairs);
  int batch_count(bool even) const;
  void cut_into_batches(const PairHistories& pairs, const std::int32_t* bucket, const Cuts& cuts);
  void rebuild_from(const PairHistories& pairs, const std::vector<PlateHistory>& plates, const ChunkedArray<double>* sums);
  void take_sides_away();
  void prune_lists();
  void merge_all();
  void keep_sums(ChunkedArray<double>& sums);
  void put_sums(const ChunkedArray<double>& sums);
  LookConstants look_constants() const;
  LookTotals look_at_spheres();
  void settle();
  AlignedArray<double> own_speeds();
  double sum_of(const AlignedArray<double>& column);
  double own_speed(std::size_t k) const;
  void choose_horizon();
  double widest_margin() const;
  double least_margin(double speed) const;
  void check_speeds(const AlignedArray<double>& speeds);
  bool choose_margins(bool fresh, const AlignedArray<double>& speeds);
  int look(int wanted);
  enum class Ways { within_margins, too_long, no_number };  // of spheres in a run of steps
  Ways look_back(int steps);
  bool unlisted_apart(int steps, const std::vector<char>& beyond) const;
  void start_from_here();
  int prepare_lists(std::int64_t wanted);
  double plane_path(int steps) const;
  void run_chunk(int steps);
  bool keeps_k_t() const {  // kernels for other exponents remember k_t
    return built_scenes[static_cast<std::size_t>(kernels_.scene)].traits.exponent != Exponent::one;
  }
  void make_room_to_save();
  void save_positions(const Batch& batch);
  void save_velocities(const Batch& batch);
  void save_history(Batch& batch);
  void restore();
  void mean_velocity();
  void parallel(int count, const std::function<void(int)>& body);
  ParallelFor on_workers() {
    return [this](int count, const std::function<void(int)>& body) { parallel(count, body); };
  }
  [[noreturn]] void fail(const std::string& what);
  void prepare_table();
  Takers takers() const;
  bool asks_are_tried() const;
  bool asks_for_partners() const;
  void prepare_graph();
  void run_graph(int steps);
  void add_pair_energy(FixedSum& sum) const;

  PairLaw pair_;
  PlateLaw plate_parameters_;
  EngineOptions engine_;
  double width_ = 0.0, depth_ = 0.0, gravity_ = 0.0;
  Domain domain_;
  Particles particles_;
  Planes planes_;
  std::vector<Batch> batches_;
  KernelTable kernels_;
  LawConstants law_{};
  PlateConstants plate_law_{};
  MotionConstants motion_{};
  double solid_volume_ = 0.0;      // of all spheres [m3]
  double energy_unit_ = 0.0;       // of stored and kinetic energies [J]
  double most_push_ = 0.0;         // of pairs on a sphere, a quarter of what sums hold: 4 F for equal spheres [N]
  double plate_force_unit_ = 0.0;  // [N]
  double largest_radius_ = 0.0, smallest_radius_ = 0.0, smallest_mass_ = 0.0;

  std::int64_t step_ = 0;
  double dt_ = 0.0, last_drift_ = 0.0;
  std::int64_t step_base_ = 0;  // time = time_base_ + (step - step_base_) dt
  double time_base_ = 0.0;
  bool lists_valid_ = false, forces_valid_ = false;

  // Integrals since the start, in energy quanta.
  Int128 dissipated_[term_count] = {}, rolling_ = 0, plate_work_ = 0;
  std::int64_t contacts_ = 0;  // touching sphere pairs
  double inserted_ = 0.0, removed_ = 0.0;

  // Lists.
  Margins inner_, outer_;                       // what is left of them [core/margins.h]
  double inner_sum_ = 0.0;                      // of the inner ones at the last prune [m]
  AlignedArray<float> speed2_;                  // of each sphere: sum over a run of steps of |v - mean_|^2 [m2/s2]
  double plate_gap_ = 0.0;                      // bound of the planes' motion that lists allow [m]
  double redo_margin_ = 0.0;                    // least margin after steps had to be done again [m]
  double kick_factor_ = 1.0;                    // on the mean speed, for spheres that will be hit
  int horizon_ = 64;                            // steps that lists should hold
  double mean_[3] = {0, 0, 0};                  // common velocity taken out of displacements [m/s]
  double drift_since_look_[3] = {0, 0, 0};      // displacement by mean_ since lists were last looked at [m]
  double plane_moved_ = 0.0;     // bound of the planes' motion since the prune [m]
  bool listed_ = false;          // lists were made since the last run of steps
  bool lists_stale_ = false;     // prune before the next step
  bool moved_since_look_ = false;
  bool moves_in_rows_ = false;   // in runs of steps of this table; particles_'s columns keep where they began until that is settled
  int unroll_ = 1;               // steps of the graph
  bool asks_ahead_ = false, asks_history_ = false;  // kernels/ask_ahead.h

  int steps_of_run_ = 0;
  TaskAsks asks_;  // of the table's tasks; empty where none asks
  std::unique_ptr<TaskTable> table_;
  std::unique_ptr<FlowGraph> graphs_[2];  // by Takers; made when needed
  bool takers_are_tried_ = false;         // there is a choice
  Quicker taking_;                        // by Takers
  Quicker asking_;                        // 0 asks for partners, 1 does not
  struct Workers;
  std::unique_ptr<Workers> workers_;
  std::unique_ptr<Saved> saved_;
  bool kicked_ = false;  // after going back: velocities are those of the half step to come, sums are zero
  bool kicked_out_of_range_ = false;
  MotionConstants first_motion_{};
  std::vector<char> merged_;
  EngineCounters counters_;
};

}  // namespace platen
