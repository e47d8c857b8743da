// The run behind run_experiment: one object that walks through the stages. Parts: experiment.cpp (the stages one after the other),
// experiment_samples.cpp (rows, frames, progress), experiment_time_step.cpp, experiment_checkpoints.cpp.
#pragma once

#include <chrono>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "protocol/experiment.h"
#include "protocol/stages.h"

namespace platen {

// [s]
inline double wall_clock() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

class Experiment {
 public:
  Experiment(const Case& c, RunFolder& folder, const RunOptions& options, const Checkpoint* from)
      : c_(c), folder_(folder), options_(options), from_(from), process_begin_(wall_clock()), wall_begin_(process_begin_), kept_at_(process_begin_) {}
  RunOutcome run();

 private:
  enum class End { done, goal_missed, stopped };

  // A stage at work, besides its own struct.
  struct Course {
    double begun = 0.0;  // wall clock [s]
    double residual_before = 0.0, dissipated_before = 0.0;  // [J]
    double stress_before = 0.0;                             // on the top plate [Pa]
    std::int64_t next_sample = 0, next_frame = 0;
  };

  // ---- stages
  void describe_run();
  Performance performance() const;
  bool reproducible() const;
  // What the hash must cover besides the bed: where the protocol stands.
  std::string stage_state() const;
  Course begin_stage(std::size_t index, Stand& stand, Stage& stage);
  // `on_the_way`: the checkpoint is one within this stage.
  End run_stage(std::size_t index, bool on_the_way);
  void close(Stand& stand, Stage& stage, double stage_begin, End end);
  static std::string exact_reason(const StageSpec& spec);
  void guard(const Measures& m);
  void warn(const std::string& text);
  // Why the run must stop now, if it must.
  std::optional<std::string> stop_request() const;

  // ---- samples
  SeriesRow row_of(const Measures& m, double speed) const;
  void sample(std::size_t stage, double speed);
  // The first step behind this one that is at or after a multiple of the interval [s]; never comes where that is 0.
  std::int64_t next_step_of(double interval) const;
  void add_frame();
  double frame_interval(const StageSpec& spec) const { return spec.frames.value_or(c_.output.frames.value_or(0.0)); }
  void show_progress(std::size_t index, const Stand& stand, const std::optional<std::int64_t>& exact, double stage_begin);

  // ---- time step
  bool limits_are_due(const Measures& m, bool regular);
  void watch_time_step(Stand& stand, const Measures& m);

  // ---- checkpoints
  // Taken right after steps and before anything looks at them, so that a run that goes on from one looks first.
  bool checkpoint_is_due() const;
  void keep(nlohmann::json stage);
  void keep_between(std::size_t next) { keep({{"index", next}}); }
  void keep_within(std::size_t index, Stand& stand, Stage& stage, Course& course);
  // From the checkpoint; returns the stage to go on with.
  std::size_t take_up();
  Course go_on_with_stage(Stand& stand, Stage& stage);

  // All that the stages know, for writing and for reading.
  template <class V>
  void each_field(V& v) {
    v("wall_seconds", wall_seconds_), v("farthest_allowed", farthest_allowed_), v("density", density_);
    v("free_dt_crit", free_.dt_crit), v("free_dt_pairs", free_.dt_pairs), v("free_dt_limit", free_.dt_limit);
    v("closed", closed_), v("current", current_), v("stage_open", stage_open_), v("strain_zero_height", strain_zero_height_);
    v("last_wanted", last_wanted_), v("looked_stress", looked_stress_), v("looked_contacts", looked_contacts_);
    v("framed_step", framed_step_);
  }

  template <class V>
  static void each_field(V& v, Stand& stand, Stage& stage, Course& course, double& elapsed) {
    v("first_step", stand.first_step), v("first_time", stand.first_time), v("strain_zero_height", stand.strain_zero_height), v("dt_step", stand.dt_step), v("dt_time", stand.dt_time);
    v("elapsed", elapsed), v("residual_before", course.residual_before), v("dissipated_before", course.dissipated_before), v("next_sample", course.next_sample), v("next_frame", course.next_frame);
    std::visit([&](auto& s) { v("memory", s); }, stage);
  }

  const Case& c_;
  RunFolder& folder_;
  const RunOptions& options_;
  const Checkpoint* from_;                   // null: from the start
  nlohmann::json kept_;                      // its account of the stages
  double process_begin_, wall_begin_;        // of this process, and as if the whole run were its work [s]
  double stage_begun_ = 0.0;                 // wall clock [s]
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

}  // namespace platen
