#include "protocol/experiment_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <csignal>

#include "protocol/guards.h"
#include "protocol/sphere_facts.h"

namespace platen {

namespace {
constexpr std::int64_t limits_every = 8192;  // steps between two looks at the limits of the time step
}

RunOutcome Experiment::run() {
  RunOutcome outcome;
  try {
    std::size_t first = 0;
    if (from_ == nullptr) {
      sim_ = make_simulation(c_, options_.threads, options_.reproducible);
      farthest_allowed_ = 1000.0 * size_of_space(c_, *sim_);
      free_ = first_step(c_).limits;
      density_ = c_.particles.table ? sphere_facts(c_).density : c_.particles.density;
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
      if (c_.stages[k].name == options_.stop_after) {  // also behind the last one: others may begin there
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
      failed.wall_seconds = wall_clock() - stage_begun_;
      if (stage_open_) closed_.push_back(failed);
    }
    folder_.log("failed", {{"message", outcome.message}}, LogLevel::error);
  }
  outcome.stages = closed_;
  outcome.performance = performance();
  folder_.finish(outcome.exit_code, outcome.exit_code == exit_numerical ? std::nullopt : std::optional(outcome.state_hash),
                 outcome.performance, outcome.stages);
  folder_.log("end", {{"exit_code", outcome.exit_code}, {"wall_seconds", wall_clock() - wall_begin_}});
  if (outcome.exit_code == exit_done && closed_.size() == c_.stages.size() && options_.stop_after.empty()) remove_checkpoints(folder_.path());  // nothing is left to do
  return outcome;
}

void Experiment::describe_run() {
  const KernelTable& kernels = sim_->kernels();
  RunInfo info;
  info.title = c_.title, info.seed = c_.seed, info.threads = options_.threads;
  info.instruction_set = to_string(kernels.instruction_set);
  info.reproducible = reproducible();
  info.scene = built_scenes[static_cast<std::size_t>(kernels.scene)].name;
  info.contacts = c_.output.contacts;
  folder_.set_info(info);
  folder_.log(from_ ? "resume" : "start", {{"title", c_.title}, {"spheres", static_cast<std::int64_t>(sim_->particles())},
                        {"threads", options_.threads}, {"instruction_set", info.instruction_set}, {"scene", info.scene},
                        {"dt", sim_->time_step()}, {"step", sim_->step()}});
}

bool Experiment::reproducible() const { return from_ != nullptr ? from_->reproducible : options_.reproducible; }

Performance Experiment::performance() const {
  Performance p;
  p.threads = options_.threads;
  p.reproducible = reproducible();
  p.wall_seconds = wall_clock() - wall_begin_;
  if (!sim_) return p;
  p.instruction_set = to_string(sim_->kernels().instruction_set);
  p.scene = built_scenes[static_cast<std::size_t>(sim_->kernels().scene)].name;
  p.particle_steps = sim_->step() * sim_->particles();
  p.rebuilds = sim_->counters().rebuilds, p.prunes = sim_->counters().prunes;
  p.redone_steps = sim_->counters().redone_steps;
  return p;
}

std::string Experiment::stage_state() const {
  return fmt::format("{} {:a} {:a}", closed_.size(), sim_->time_step(), strain_zero_height_.value_or(-1.0));
}

void Experiment::warn(const std::string& text) {
  if (std::find(current_.warnings.begin(), current_.warnings.end(), text) != current_.warnings.end()) return;
  current_.warnings.push_back(text);
  folder_.log("warning", {{"stage", current_.name}, {"message", text}}, LogLevel::warning);
}

std::optional<std::string> Experiment::stop_request() const {
  if (options_.stop_signal && options_.stop_signal->load() != 0) return fmt::format("signal {}{}", options_.stop_signal->load(), options_.stop_signal->load() == SIGINT ? " (Ctrl-C)" : "");
  if (options_.max_walltime && wall_clock() - process_begin_ > *options_.max_walltime)
    return fmt::format("wall time of {:.4g} s is over", *options_.max_walltime);
  return std::nullopt;
}

Experiment::Course Experiment::begin_stage(std::size_t index, Stand& stand, Stage& stage) {
  const StageSpec& spec = c_.stages[index];
  Course course;
  course.begun = stage_begun_ = wall_clock();
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
  course.stress_before = current_.last.measures.stress_top;
  course.residual_before = current_.last.measures.energy_residual, course.dissipated_before = current_.last.measures.ledger.dissipated();
  course.next_sample = next_step_of(c_.output.series);
  if (frame_interval(spec) > 0.0) add_frame();
  course.next_frame = next_step_of(frame_interval(spec));
  return course;
}

Experiment::End Experiment::run_stage(std::size_t index, bool on_the_way) {
  const StageSpec& spec = c_.stages[index];
  Stand stand{*sim_, c_, spec, sim_->step(), sim_->time(), strain_zero_height_, sim_->step(), 0.0};
  Stage stage = make_stage(spec);
  Course course = on_the_way ? go_on_with_stage(stand, stage) : begin_stage(index, stand, stage);
  stage_begun_ = course.begun;
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
        if (sim_->step() < next_sample) next_sample = next_step_of(c_.output.series);
        if (sim_->step() < course.next_frame) course.next_frame = next_step_of(frame_interval(spec));
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
    if (!over && stop_) over = true, end = End::stopped, current_.end_reason = *stop_, current_.reached = false;
    if (over) break;

    if (sim_->step() >= next_sample) {
      sample(index, speed);
      next_sample = next_step_of(c_.output.series);
    }
    if (sim_->step() >= course.next_frame) {
      add_frame();
      course.next_frame = next_step_of(frame_interval(spec));
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
    // Before the look that may find the goal missed: `resume` goes on from here once the stage may last longer.
    if (stop_ || checkpoint_is_due() || (sim_->step() >= longest && !(exact && sim_->step() >= *exact))) keep_within(index, stand, stage, course);
  }

  sample(index, speed);
  if (frame_interval(spec) > 0.0 && end != End::stopped) add_frame();
  const Measures& m = current_.last.measures;
  if (spec.kind == StageKind::hold && end != End::stopped && std::fabs(m.stress_top - spec.stress) > 0.02 * spec.stress)
    warn(!m.top_touches ? "the top plate has not come to the bed: `compress` before it, or a longer duration"
                        : fmt::format("the stress at its end is {}, not {}: a longer duration lets it settle", pretty(m.stress_top, "Pa"), pretty(spec.stress, "Pa")));
  if ((spec.kind == StageKind::compress || spec.kind == StageKind::crush) && end == End::done && spec.until.stress && course.stress_before < *spec.until.stress && m.stress_top > 1.1 * *spec.until.stress)
    warn(fmt::format("the stress has gone {:.0f} % past its goal of {} between two looks: a lower speed or a smaller engine.check_every comes nearer",
                     100.0 * (m.stress_top / *spec.until.stress - 1.0), pretty(*spec.until.stress, "Pa")));
  const double dissipated = m.ledger.dissipated();
  current_.residual_share = !c_.output.energy ? std::numeric_limits<double>::quiet_NaN() : (m.energy_residual - residual_before) / std::max(dissipated - dissipated_before, 0.01 * dissipated);
  if (std::fabs(current_.residual_share) > 0.01) warn(fmt::format("the energy ledger is open by {:.2g} % of what was dissipated; a smaller time step closes it", 100.0 * std::fabs(current_.residual_share)));
  close(stand, stage, stage_begin, end);
  return end;
}

void Experiment::close(Stand& stand, Stage& stage, double stage_begin, End end) {
  current_.last_step = sim_->step(), current_.time_end = sim_->time();
  current_.wall_seconds = wall_clock() - stage_begin;
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

std::string Experiment::exact_reason(const StageSpec& spec) {
  const bool moves = spec.until.displacement.has_value();
  if (moves && !(spec.until.duration && *spec.until.duration < *spec.until.displacement / spec.speed)) return fmt::format("displacement {} done", pretty(*spec.until.displacement, "m"));
  const double duration = spec.duration.value_or(spec.until.duration.value_or(0.0));
  return fmt::format("duration {} over", pretty(duration, "s"));
}

void Experiment::guard(const Measures& m) {
  refuse_fast_spins(*sim_, m);
  refuse_lost_spheres(*sim_, m, farthest_allowed_);
  const bool quasi_static = current_.kind == StageKind::compress || current_.kind == StageKind::crush;
  if (quasi_static && m.stress_top > 1e3) {
    const double I = row_of(m, c_.stages[closed_.size()].speed).inertial_number;
    if (I > 1e-3) warn("inertial number above 1e-3 at more than 1 kPa: not quasi-static");
  }
}

RunOutcome run_experiment(const Case& c, RunFolder& folder, const RunOptions& options, const Checkpoint* from) {
  return Experiment(c, folder, options, from).run();
}

}  // namespace platen
