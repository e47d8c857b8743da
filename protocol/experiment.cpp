#include "protocol/experiment.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cmath>
#include <limits>

#include "protocol/checkpoint_fields.h"
#include "protocol/guards.h"
#include "protocol/stages.h"

namespace platen {

namespace {

constexpr const char* no_checkpoint = "a checkpoint could not be written: log.jsonl says why";
constexpr std::int64_t limits_every = 8192;  // steps between two looks at the limits of the time step

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

class Experiment {
 public:
  Experiment(const Case& c, RunFolder& folder, const RunOptions& options, const Checkpoint* from)
      : c_(c), folder_(folder), options_(options), from_(from), process_begin_(now()), wall_begin_(process_begin_), kept_at_(process_begin_) {}

  RunOutcome run() {
    RunOutcome outcome;
    try {
      std::size_t first = 0;
      if (from_ == nullptr) {
        sim_ = make_simulation(c_, options_.threads, options_.reproducible);
        farthest_allowed_ = 1000.0 * size_of_space(c_, *sim_);
        free_ = first_step(c_).limits;
        density_ = c_.particles.table ? c_.particles.table->density.front() : c_.particles.density;
      } else {
        sim_ = make_simulation(c_, *from_, options_.threads);
        first = take_up();
      }
      describe_run();
      for (std::size_t k = first; k < c_.stages.size(); ++k) {
        const End end = run_stage(k, from_ != nullptr && k == first && stage_open_);
        if (end == End::goal_missed) {
          outcome.exit_code = exit_goal;
          outcome.message = fmt::format("stage {}: {}", closed_.back().name, closed_.back().end_reason);
          break;
        }
        if (end == End::stopped) {
          outcome.exit_code = exit_stopped;
          outcome.message = fmt::format("stopped in stage {}: {}", closed_.back().name, closed_.back().end_reason);
          break;
        }
        if (c_.stages[k].name == options_.stop_after && k + 1 < c_.stages.size()) {
          keep_between(k + 1);
          break;
        }
      }
      outcome.state_hash = sim_->state_hash(stage_state());
    } catch (const RunError& error) {
      outcome.exit_code = exit_numerical;
      outcome.message = error.what();
      if (kept_step_) outcome.message += fmt::format("; the last checkpoint is that of step {}", *kept_step_);
      if (!closed_.empty() || stage_open_) {
        StageResult failed = current_;
        failed.end_reason = "failed";
        failed.reached = false;
        failed.last_step = sim_->step(), failed.time_end = sim_->time();
        if (stage_open_) closed_.push_back(failed);
      }
      folder_.log("failed", {{"message", outcome.message}}, LogLevel::error);
    }
    outcome.stages = closed_;
    outcome.performance = performance();
    folder_.finish(outcome.exit_code, outcome.exit_code == exit_numerical ? std::nullopt : std::optional(outcome.state_hash),
                   outcome.performance, outcome.stages);
    folder_.log("end", {{"exit_code", outcome.exit_code}, {"wall_seconds", now() - wall_begin_}});
    if (outcome.exit_code == exit_done && closed_.size() == c_.stages.size()) remove_checkpoints(folder_.path());  // nothing is left to do
    return outcome;
  }

 private:
  enum class End { done, goal_missed, stopped };

  void describe_run() {
    const KernelTable& kernels = sim_->kernels();
    RunInfo info;
    info.title = c_.title, info.seed = c_.seed, info.threads = options_.threads;
    info.instruction_set = to_string(kernels.instruction_set);
    info.scene = built_scenes[static_cast<std::size_t>(kernels.scene)].name;
    info.contacts = c_.output.contacts;
    folder_.set_info(info);
    folder_.log(from_ ? "resume" : "start", {{"title", c_.title}, {"spheres", static_cast<std::int64_t>(sim_->particles())},
                          {"threads", options_.threads}, {"instruction_set", info.instruction_set}, {"scene", info.scene},
                          {"dt", sim_->time_step()}, {"step", sim_->step()}});
  }

  // ---- checkpoints --------------------------------------------------------------------------------------------------
  // Taken right after steps and before anything looks at them, so that a run that goes on from one looks first.

  // All that the stages know, for writing and for reading.
  template <class V>
  void each_field(V& v) {
    v("wall_seconds", wall_seconds_), v("farthest_allowed", farthest_allowed_), v("density", density_);
    v("free_dt_crit", free_.dt_crit), v("free_dt_pairs", free_.dt_pairs), v("free_dt_limit", free_.dt_limit);
    v("closed", closed_), v("current", current_), v("stage_open", stage_open_), v("strain_zero_height", strain_zero_height_);
    v("last_wanted", last_wanted_), v("looked_stress", looked_stress_), v("looked_contacts", looked_contacts_);
    v("framed_step", framed_step_);
  }

  bool checkpoint_is_due() const {
    if (options_.checkpoint_signal && options_.checkpoint_signal->load() != checkpoints_asked_) return true;
    if (!(c_.output.checkpoint > 0.0)) return false;
    // Never more than a twentieth of the time for them.
    return now() - kept_at_ > std::max(c_.output.checkpoint, 20.0 * keeping_takes_);
  }

  void keep(nlohmann::json stage) {
    const double begin = now();
    if (options_.checkpoint_signal) checkpoints_asked_ = options_.checkpoint_signal->load();
    folder_.sync();
    wall_seconds_ = begin - wall_begin_;
    nlohmann::json experiment = nlohmann::json::object();
    fields::Writer writer{experiment};
    each_field(writer);
    experiment["rows"] = folder_.rows(), experiment["frames"] = folder_.frames();
    experiment["stage"] = std::move(stage);
    Checkpoint checkpoint;
    checkpoint.bed = sim_->whole_state();
    checkpoint.experiment = experiment.dump();
    checkpoint.case_text = c_.text, checkpoint.start_time = folder_.start_time();
    checkpoint.instruction_set = to_string(sim_->kernels().instruction_set);
    checkpoint.reproducible = from_ ? from_->reproducible : options_.reproducible;
    if (from_) checkpoint.density = from_->density;
    else if (c_.particles.table) checkpoint.density = densities_by_id(*c_.particles.table);
    else checkpoint.density = {c_.particles.density};
    try {
      write_checkpoint(folder_.path(), checkpoint);
      kept_step_ = sim_->step();
      folder_.log("checkpoint", {{"step", sim_->step()}, {"seconds", now() - begin}});
    } catch (const std::exception& error) {  // the run itself can go on, with the older one
      folder_.log("checkpoint failed", {{"message", error.what()}}, LogLevel::warning);
      std::vector<std::string>& warnings = stage_open_ ? current_.warnings : closed_.back().warnings;
      if (std::find(warnings.begin(), warnings.end(), no_checkpoint) == warnings.end()) warnings.push_back(no_checkpoint);
    }
    kept_at_ = now(), keeping_takes_ = kept_at_ - begin;
  }

  void keep_between(std::size_t next) { keep({{"index", next}}); }

  static std::vector<double> densities_by_id(const ParticleTable& t) {
    std::vector<std::size_t> order(t.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return t.id[a] < t.id[b]; });
    std::vector<double> density;
    for (const std::size_t k : order) density.push_back(t.density[k]);
    return density;
  }

  // From the checkpoint; returns the stage to go on with.
  std::size_t take_up() {
    try {
      kept_ = nlohmann::json::parse(from_->experiment);
      fields::Reader reader{kept_};
      each_field(reader);
      const auto index = kept_.at("stage").at("index").get<std::size_t>();
      if (index >= c_.stages.size() || (stage_open_ && c_.stages[index].name != current_.name)) throw OutputError("the checkpoint does not fit the case: it has other stages");
      wall_begin_ = process_begin_ - wall_seconds_;
      kept_step_ = sim_->step();
      return index;
    } catch (const nlohmann::json::exception& error) {
      throw OutputError(std::string("the checkpoint does not fit this version of platen: ") + error.what());
    }
  }

  Performance performance() const {
    Performance p;
    p.threads = options_.threads;
    p.wall_seconds = now() - wall_begin_;
    if (!sim_) return p;
    p.instruction_set = to_string(sim_->kernels().instruction_set);
    p.scene = built_scenes[static_cast<std::size_t>(sim_->kernels().scene)].name;
    p.particle_steps = sim_->step() * sim_->particles();
    p.rebuilds = sim_->counters().rebuilds, p.prunes = sim_->counters().prunes;
    p.redone_steps = sim_->counters().redone_steps;
    return p;
  }

  // What the hash must cover besides the bed: where the protocol stands.
  std::string stage_state() const {
    return fmt::format("{} {:a} {:a}", closed_.size(), sim_->time_step(), strain_zero_height_.value_or(-1.0));
  }

  SeriesRow row_of(const Measures& m, double speed) const {
    SeriesRow row;
    row.stage = current_.name;
    row.measures = m;
    row.kinetic_to_potential = m.potential_energy != 0.0 ? m.kinetic_energy / m.potential_energy : std::numeric_limits<double>::quiet_NaN();
    if (strain_zero_height_) row.strain = 1.0 - m.height / *strain_zero_height_;
    // I = strain rate * d * sqrt(rho/p) [A34]; no meaning without pressure.
    row.inertial_number = std::numeric_limits<double>::quiet_NaN();
    if (m.stress_top > 0.0 && m.height > 0.0) {
      row.inertial_number = speed / m.height * 2.0 * sim_->mean_radius() * std::sqrt(density_ / m.stress_top);
    }
    if (!c_.output.energy) {
      const double none = std::numeric_limits<double>::quiet_NaN();
      Measures& r = row.measures;
      r.energy_residual = none;
      r.ledger = {none, none, none, none, none, none, none, none, none, none, none, none};
    }
    return row;
  }

  void sample(std::size_t stage, double speed) {
    const Measures m = sim_->measure();
    if (m.deepest_overlap > 0.25) warn("an overlap above a quarter of the diameter: the law is meant for small ones; stiffer spheres or less load help");
    current_.last = row_of(m, speed);
    folder_.append(current_.last, static_cast<int>(stage));
  }

  // Steps from now to the first one at or after the next multiple of the sampling interval.
  std::int64_t steps_to_sample() const {
    const double dt = sim_->time_step(), interval = c_.output.series;
    const double done = std::floor(sim_->time() / interval * (1.0 + 1e-12) + 1e-9);
    return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(((done + 1.0) * interval - sim_->time()) / dt - 1e-6)));
  }

  // The same for frames; never where there are none.
  std::int64_t step_of_next_frame(double interval) const {
    if (!(interval > 0.0)) return std::numeric_limits<std::int64_t>::max();
    const double done = std::floor(sim_->time() / interval * (1.0 + 1e-12) + 1e-9);
    return sim_->step() + std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(((done + 1.0) * interval - sim_->time()) / sim_->time_step() - 1e-6)));
  }

  void add_frame() {
    if (framed_step_ == sim_->step()) return;  // the last of a stage is the first of the next
    framed_step_ = sim_->step();
    folder_.add_frame(sim_->snapshot(), sim_->periodic() ? c_.box.width : 0.0, sim_->periodic() ? c_.box.depth : 0.0);
  }

  // Limits are found anew every so many steps, and where the bed has become clearly denser or more loaded than it was:
  // plates stiffen under load, and a fast plate loads a bed in less than limits_every steps.
  bool limits_are_due(const Measures& m, bool regular) {
    const double stress = std::max(m.stress_top, m.stress_bottom);
    const auto contacts = static_cast<double>(m.contacts), few = 1.5 * sim_->particles();
    const bool due = regular || stress > 1.3 * looked_stress_ + 100.0 || contacts > 1.1 * std::max(looked_contacts_, few);
    if (regular) looked_stress_ = looked_contacts_ = 0.0;
    if (due) looked_stress_ = std::max(looked_stress_, stress), looked_contacts_ = std::max(looked_contacts_, contacts);
    return due;
  }

  // The automatic step, or the watch over a fixed one.
  void watch_time_step(Stand& stand, const Measures& m) {
    const StepLimits limits = sim_->step_limits();
    if (!c_.time.step && sim_->time_step() > 0.9 * limits.dt_limit)  // before this look, that is
      warn(sim_->time_step() > limits.dt_limit ? "time step above dt_limit for a while" : "time step above 0.9 dt_limit for a while");
    StepRange& range = current_.time_step;
    range.dt_crit = std::min(range.dt_crit, limits.dt_crit), range.dt_limit = std::min(range.dt_limit, limits.dt_limit);
    if (std::isfinite(limits.dt_limit)) range.largest_share = std::max(range.largest_share, sim_->time_step() / limits.dt_limit);
    const auto log_limits = [&] {  // with the step that holds from now on
      if (std::isfinite(limits.dt_limit))
        folder_.log("limits", {{"step", sim_->step()}, {"dt", sim_->time_step()}, {"dt_crit", limits.dt_crit}, {"dt_pairs", limits.dt_pairs}, {"dt_limit", limits.dt_limit}});
    };
    if (c_.time.step) {
      log_limits();
      const double ratio = sim_->time_step() / limits.dt_limit;
      if (ratio > 1.0 && !c_.time.allow_unstable) {
        std::string ruled_by;
        sim_->step_limits(ruled_by);
        throw RunError(fmt::format("the time step {:.4g} s is above dt_limit = {:.4g} s of the bed at step {} (ruled by {}); use a smaller time.step or \"auto\"",
                                   sim_->time_step(), limits.dt_limit, sim_->step(), ruled_by));
      }
      if (ratio > 0.9) warn(ratio > 1.0 ? "time step above dt_limit" : "time step above 0.9 dt_limit");
      return;
    }
    StepLimits ruling = limits;
    const StepLimits& free = free_;
    // A loose bed says nothing of the dense one that it is about to become.
    if (m.coordination_number < 3.0) ruling.dt_pairs = std::min(ruling.dt_pairs, free.dt_pairs), ruling.dt_limit = std::min(ruling.dt_limit, free.dt_limit);
    const StageKind kind = current_.kind;
    const double wanted = floor_to_grid(std::min(c_.time.safety * ruling.dt_pairs, 0.8 * ruling.dt_limit));
    // Shorter at once, longer only where two looks in a row allow it, and never while spheres fall or are shaken: a bed in the
    // air allows a step that its next impact does not.
    const double now = sim_->time_step(), allowed = std::min(wanted, last_wanted_.value_or(wanted));
    last_wanted_ = wanted;
    const bool loose = kind == StageKind::fill || kind == StageKind::vibrate;
    sim_->set_time_step(loose ? std::min(now, wanted) : allowed);
    log_limits();
    stand.time_step_changed();
  }

  void warn(const std::string& text) {
    if (std::find(current_.warnings.begin(), current_.warnings.end(), text) != current_.warnings.end()) return;
    current_.warnings.push_back(text);
    folder_.log("warning", {{"stage", current_.name}, {"message", text}}, LogLevel::warning);
  }

  // Why the run must stop now, if it must.
  std::optional<std::string> stop_request() const {
    if (options_.stop_signal && options_.stop_signal->load() != 0) return fmt::format("signal {}{}", options_.stop_signal->load(), options_.stop_signal->load() == SIGINT ? " (Ctrl-C)" : "");
    if (options_.max_walltime && now() - process_begin_ > *options_.max_walltime)
      return fmt::format("wall time of {:.4g} s is over", *options_.max_walltime);
    return std::nullopt;
  }

  // A stage at work, besides its own struct.
  struct Course {
    double begun = 0.0;  // wall clock [s]
    double residual_before = 0.0, dissipated_before = 0.0;  // [J]
    std::int64_t next_sample = 0, next_frame = 0;
  };

  template <class V>
  static void each_field(V& v, Stand& stand, Stage& stage, Course& course, double& elapsed) {
    v("first_step", stand.first_step), v("first_time", stand.first_time), v("strain_zero_height", stand.strain_zero_height), v("dt_step", stand.dt_step), v("dt_time", stand.dt_time);
    v("elapsed", elapsed), v("residual_before", course.residual_before), v("dissipated_before", course.dissipated_before), v("next_sample", course.next_sample), v("next_frame", course.next_frame);
    std::visit([&](auto& s) { v("memory", s); }, stage);
  }

  void keep_within(std::size_t index, Stand& stand, Stage& stage, Course& course) {
    nlohmann::json state = {{"index", index}};
    fields::Writer writer{state};
    double elapsed = now() - course.begun;
    each_field(writer, stand, stage, course, elapsed);
    keep(std::move(state));
  }

  double frame_interval(const StageSpec& spec) const { return spec.frames.value_or(c_.output.frames.value_or(0.0)); }

  Course begin_stage(std::size_t index, Stand& stand, Stage& stage) {
    const StageSpec& spec = c_.stages[index];
    Course course;
    course.begun = now();
    current_ = StageResult{};
    current_.name = spec.name, current_.kind = spec.kind;
    current_.first_step = sim_->step(), current_.time_begin = sim_->time();
    current_.particles = sim_->particles();
    stage_open_ = true;
    last_wanted_.reset();
    std::visit([&](auto& s) { s.begin(stand); }, stage);
    if (spec.kind == StageKind::vibrate || spec.kind == StageKind::release) stand.strain_zero_height.reset();  // another bed
    strain_zero_height_ = stand.strain_zero_height;
    if (spec.kind == StageKind::crush && sim_->confined()) warn("the sides are still there: its strength is not an unconfined one; a stage `release` takes them away");
    sample(index, spec.speed);
    course.residual_before = current_.last.measures.energy_residual, course.dissipated_before = current_.last.measures.ledger.dissipated();
    course.next_sample = sim_->step() + steps_to_sample();
    if (frame_interval(spec) > 0.0) add_frame();
    course.next_frame = step_of_next_frame(frame_interval(spec));
    return course;
  }

  Course go_on_with_stage(Stand& stand, Stage& stage) {
    Course course;
    double elapsed = 0.0;
    try {
      fields::Reader reader{kept_.at("stage")};
      each_field(reader, stand, stage, course, elapsed);
    } catch (const nlohmann::json::exception& error) {
      throw OutputError(std::string("the checkpoint does not fit this version of platen: ") + error.what());
    }
    course.begun = now() - elapsed;
    return course;
  }

  // `on_the_way`: the checkpoint is one within this stage.
  End run_stage(std::size_t index, bool on_the_way) {
    const StageSpec& spec = c_.stages[index];
    Stand stand{*sim_, c_, spec, sim_->step(), sim_->time(), strain_zero_height_, sim_->step(), 0.0};
    Stage stage = make_stage(spec);
    Course course = on_the_way ? go_on_with_stage(stand, stage) : begin_stage(index, stand, stage);
    const double speed = spec.speed, stage_begin = course.begun, residual_before = course.residual_before, dissipated_before = course.dissipated_before;
    std::int64_t& next_sample = course.next_sample;

    End end = End::done;
    const std::int64_t grid = c_.engine.check_every, limits_grid = std::max<std::int64_t>(1, limits_every / grid) * grid;
    for (;;) {
      // On the grid, in absolute step numbers: goals, servo, time step. A stage that needs no time ends at its first look.
      const bool first_look = sim_->step() == stand.first_step, on_grid = sim_->step() % grid == 0;
      bool over = false;
      if (on_grid || first_look) {
        const Measures m = sim_->measure(false);
        Look look{m, stand.strain_zero_height ? 1.0 - m.height / *stand.strain_zero_height : std::numeric_limits<double>::quiet_NaN()};
        std::visit([&](auto& s) { s.update(stand, look); }, stage);
        strain_zero_height_ = stand.strain_zero_height;
        if (strain_zero_height_) look.strain = 1.0 - m.height / *strain_zero_height_;
        if (!first_look || spec.kind == StageKind::fill)
          if (const auto reason = std::visit([&](auto& s) { return s.done(stand, look); }, stage)) current_.end_reason = *reason, over = true;
        guard(m);
        if (on_grid && !first_look && limits_are_due(m, sim_->step() % limits_grid == 0)) {
          watch_time_step(stand, m);
          if (sim_->step() < next_sample) next_sample = sim_->step() + steps_to_sample();
          if (sim_->step() < course.next_frame) course.next_frame = step_of_next_frame(frame_interval(spec));
        }
      }
      // After the time step may have changed.
      const auto exact = std::visit([&](auto& s) { return s.last_step(stand); }, stage);
      const std::int64_t longest = stand.step_not_before(spec.max_duration);
      if (!over && exact && sim_->step() >= *exact) over = true, current_.end_reason = exact_reason(spec);
      if (!over && sim_->step() >= longest) {
        over = true, end = End::goal_missed;
        current_.reached = false;
        current_.end_reason = fmt::format("goal not reached within max_duration = {:.4g} s", spec.max_duration);
        const std::string missing = what_is_missing(stand, sim_->measure(false));
        if (!missing.empty()) current_.end_reason += ": " + missing;
      }
      if (!over) {
        if (stop_) over = true, end = End::stopped, current_.end_reason = *stop_, current_.reached = false;
      }
      if (over) break;

      if (sim_->step() >= next_sample) {
        sample(index, speed);
        next_sample = sim_->step() + steps_to_sample();
      }
      if (sim_->step() >= course.next_frame) {
        add_frame();
        course.next_frame = step_of_next_frame(frame_interval(spec));
      }
      std::int64_t target = (sim_->step() / grid + 1) * grid;
      if (exact) target = std::min(target, std::max(*exact, sim_->step() + 1));
      target = std::min({target, next_sample, course.next_frame});
      target = std::min(target, longest);
      current_.time_step.smallest = std::min(current_.time_step.smallest, sim_->time_step());
      current_.time_step.largest = std::max(current_.time_step.largest, sim_->time_step());
      sim_->advance(target - sim_->step());
      show_progress(index, stand, exact, stage_begin);
      stop_ = stop_request();
      if (stop_ || checkpoint_is_due()) keep_within(index, stand, stage, course);
    }

    sample(index, speed);
    if (frame_interval(spec) > 0.0 && end != End::stopped) add_frame();
    const Measures& m = current_.last.measures;
    if (spec.kind == StageKind::hold && end != End::stopped && std::fabs(m.stress_top - spec.stress) > 0.02 * spec.stress)
      warn(fmt::format("the stress at its end is {}, not {}: a longer duration lets it settle", pretty(m.stress_top, "Pa"), pretty(spec.stress, "Pa")));
    const double dissipated = m.ledger.dissipated();
    current_.residual_share = !c_.output.energy ? std::numeric_limits<double>::quiet_NaN() : (m.energy_residual - residual_before) / std::max(dissipated - dissipated_before, 0.01 * dissipated);
    if (std::fabs(current_.residual_share) > 0.01) warn(fmt::format("the energy ledger is open by {:.2g} % of what was dissipated; a smaller time step closes it", 100.0 * std::fabs(current_.residual_share)));
    close(index, stand, stage, stage_begin, end);
    return end;
  }

  void close(std::size_t, Stand& stand, Stage& stage, double stage_begin, End end) {
    current_.last_step = sim_->step(), current_.time_end = sim_->time();
    current_.wall_seconds = now() - stage_begin;
    current_.strain_zero_height = strain_zero_height_;
    const Snapshot snapshot = sim_->snapshot();
    // Without sides a bed has no volume that could be told from its height.
    const bool confined = sim_->area() > 0.0 && sim_->confined();
    if (confined && snapshot.z_top > snapshot.z_bottom) current_.bed = bed_stress(snapshot, c_.box.width, c_.box.depth);
    const double area = confined ? sim_->area() : std::numeric_limits<double>::quiet_NaN();
    const Profile heights = sim_->area() > 0.0 ? profile(snapshot, area, c_.output.slabs) : Profile{};
    if (end != End::stopped) {
      const StepLimits limits = sim_->step_limits(current_.time_step.ruled_by);
      current_.time_step.dt_crit = std::min(current_.time_step.dt_crit, limits.dt_crit);
      current_.time_step.dt_limit = std::min(current_.time_step.dt_limit, limits.dt_limit);
      if (std::isfinite(limits.dt_limit)) current_.time_step.largest_share = std::max(current_.time_step.largest_share, sim_->time_step() / limits.dt_limit);
      if (c_.time.step && sim_->time_step() > 0.9 * limits.dt_limit) warn(sim_->time_step() > limits.dt_limit ? "time step above dt_limit" : "time step above 0.9 dt_limit");
      std::visit([&](auto& s) { s.end(stand, current_); }, stage);
    }
    closed_.push_back(current_);
    stage_open_ = false;
    folder_.close_stage(current_, snapshot, heights);
    folder_.log("stage", {{"name", current_.name}, {"end_reason", current_.end_reason}, {"steps", current_.last_step - current_.first_step},
                          {"wall_seconds", current_.wall_seconds}});
    if (options_.stage_closed) options_.stage_closed(current_);
  }

  static std::string exact_reason(const StageSpec& spec) {
    const bool moves = spec.until.displacement.has_value();
    if (moves && !(spec.until.duration && *spec.until.duration < *spec.until.displacement / spec.speed)) return fmt::format("displacement {} done", pretty(*spec.until.displacement, "m"));
    const double duration = spec.duration.value_or(spec.until.duration.value_or(0.0));
    return fmt::format("duration {} over", pretty(duration, "s"));
  }

  void guard(const Measures& m) {
    refuse_fast_spins(*sim_, m);
    refuse_lost_spheres(*sim_, m, farthest_allowed_);
    const bool quasi_static = current_.kind == StageKind::compress || current_.kind == StageKind::crush;
    if (quasi_static && m.stress_top > 1e3) {
      const double I = row_of(m, c_.stages[closed_.size()].speed).inertial_number;
      if (I > 1e-3) warn("inertial number above 1e-3 at more than 1 kPa: not quasi-static");
    }
  }

  void show_progress(std::size_t index, const Stand& stand, const std::optional<std::int64_t>& exact, double stage_begin) {
    const double t = now();
    if (!options_.progress || t - last_progress_ < 0.2) return;
    Progress p;
    p.stage = current_.name;
    p.stage_number = static_cast<int>(index) + 1, p.stages = static_cast<int>(c_.stages.size());
    p.step = sim_->step(), p.time = sim_->time(), p.stage_time = stand.stage_time();
    const StageSpec& spec = c_.stages[index];
    const SeriesRow& row = current_.last;
    if (exact)
      p.fraction = static_cast<double>(sim_->step() - stand.first_step) / static_cast<double>(std::max<std::int64_t>(1, *exact - stand.first_step));
    else if (spec.kind == StageKind::compress && spec.until.stress)
      p.fraction = std::sqrt(std::clamp(row.measures.stress_top / *spec.until.stress, 0.0, 1.0));  // stress grows ever faster
    else if (spec.kind == StageKind::crush && spec.until.strain && !std::isnan(row.strain))
      p.fraction = std::clamp(row.strain / *spec.until.strain, 0.0, 1.0);
    p.wall_seconds = t - wall_begin_;
    if (p.fraction && *p.fraction > 0.02) p.seconds_left = (t - stage_begin) * (1.0 - *p.fraction) / *p.fraction;
    const double steps = static_cast<double>(sim_->step() - progress_step_);
    if (last_progress_ > 0.0) p.particle_steps_per_second = steps * sim_->particles() / (t - last_progress_);
    p.row = row;
    progress_step_ = sim_->step();
    last_progress_ = t;
    options_.progress(p);
  }

  const Case& c_;
  RunFolder& folder_;
  const RunOptions& options_;
  const Checkpoint* from_;                   // null: from the start
  nlohmann::json kept_;                      // its account of the stages
  double process_begin_, wall_begin_;        // of this process, and as if the whole run were its work [s]
  double wall_seconds_ = 0.0;                // so far, as a checkpoint has it
  double kept_at_, keeping_takes_ = 0.0;     // when the last checkpoint was written, and for how long
  int checkpoints_asked_ = 0;
  std::optional<std::int64_t> kept_step_;    // of the last checkpoint
  std::optional<std::string> stop_;          // why to stop, seen after the last steps
  StepLimits free_;                          // of a dense bed of the smallest spheres
  double density_ = 0.0;                     // for inertial numbers [kg/m3]
  std::unique_ptr<Simulation> sim_;
  std::vector<StageResult> closed_;
  StageResult current_;
  bool stage_open_ = false;
  std::optional<double> strain_zero_height_;
  std::optional<double> last_wanted_;  // step that the look before allowed; empty at the start of a stage [s]
  double farthest_allowed_ = std::numeric_limits<double>::infinity();  // of any coordinate [m]
  std::int64_t framed_step_ = -1;      // of the last frame
  double looked_stress_ = 0.0, looked_contacts_ = 0.0;  // largest at looks at the limits since the last regular one
  double last_progress_ = 0.0;
  std::int64_t progress_step_ = 0;
};

}  // namespace

RunOutcome run_experiment(const Case& c, RunFolder& folder, const RunOptions& options, const Checkpoint* from) {
  return Experiment(c, folder, options, from).run();
}

CheckpointFacts facts_of(const Checkpoint& checkpoint) try {
  const nlohmann::json experiment = nlohmann::json::parse(checkpoint.experiment);
  CheckpointFacts facts;
  facts.rows = experiment.at("rows").get<std::size_t>(), facts.frames = experiment.at("frames").get<std::size_t>();
  facts.stage = experiment.at("stage").at("index").get<std::size_t>();
  fields::from_json(experiment.at("closed"), facts.closed);
  return facts;
} catch (const nlohmann::json::exception& error) {
  throw OutputError(std::string("the checkpoint does not fit this version of platen: ") + error.what());
}

}  // namespace platen
