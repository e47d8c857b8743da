#include "protocol/experiment_run.h"

#include <algorithm>

#include "protocol/checkpoint_fields.h"

namespace platen {

namespace {

constexpr const char* no_checkpoint = "a checkpoint could not be written: log.jsonl says why";

std::vector<double> densities_by_id(const ParticleTable& t) {
  std::vector<std::size_t> order(t.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return t.id[a] < t.id[b]; });
  std::vector<double> density;
  for (const std::size_t k : order) density.push_back(t.density[k]);
  return density;
}

}  // namespace

bool Experiment::checkpoint_is_due() const {
  if (options_.checkpoint_signal && options_.checkpoint_signal->load() != checkpoints_asked_) return true;
  if (!(c_.output.checkpoint > 0.0)) return false;
  // Never more than a twentieth of the time for them.
  return wall_clock() - kept_at_ > std::max(c_.output.checkpoint, 20.0 * keeping_takes_);
}

void Experiment::keep(nlohmann::json stage) {
  const double begin = wall_clock();
  if (options_.checkpoint_signal) checkpoints_asked_ = options_.checkpoint_signal->load();
  folder_.sync();
  wall_seconds_ = begin - wall_begin_;
  nlohmann::json experiment = nlohmann::json::object();
  fields::Writer writer{experiment};
  each_field(writer);
  experiment["rows"] = folder_.rows(), experiment["frames"] = fields::to_json(folder_.frame_times());
  experiment["stage"] = std::move(stage);
  Checkpoint checkpoint;
  checkpoint.bed = sim_->whole_state();
  checkpoint.experiment = experiment.dump();
  checkpoint.case_text = c_.text, checkpoint.start_time = folder_.start_time();
  checkpoint.instruction_set = to_string(sim_->kernels().instruction_set);
  checkpoint.reproducible = reproducible();
  if (from_) checkpoint.density = from_->density;
  else if (c_.particles.table) checkpoint.density = densities_by_id(*c_.particles.table);
  else checkpoint.density = {c_.particles.density};
  try {
    write_checkpoint(folder_.path(), checkpoint);
    kept_step_ = sim_->step();
    folder_.log("checkpoint", {{"step", sim_->step()}, {"seconds", wall_clock() - begin}});
  } catch (const std::exception& error) {  // the run itself can go on, with the older one
    folder_.log("checkpoint failed", {{"message", error.what()}}, LogLevel::warning);
    std::vector<std::string>& warnings = stage_open_ ? current_.warnings : closed_.back().warnings;
    if (std::find(warnings.begin(), warnings.end(), no_checkpoint) == warnings.end()) warnings.push_back(no_checkpoint);
  }
  kept_at_ = wall_clock(), keeping_takes_ = kept_at_ - begin;
}

void Experiment::keep_within(std::size_t index, Stand& stand, Stage& stage, Course& course) {
  nlohmann::json state = {{"index", index}};
  fields::Writer writer{state};
  double elapsed = wall_clock() - course.begun;
  each_field(writer, stand, stage, course, elapsed);
  keep(std::move(state));
}

std::size_t Experiment::take_up() {
  try {
    kept_ = nlohmann::json::parse(from_->experiment);
    fields::Reader reader{kept_};
    each_field(reader);
    const auto index = kept_.at("stage").at("index").get<std::size_t>();
    if (index > c_.stages.size() || (stage_open_ && (index == c_.stages.size() || c_.stages[index].name != current_.name))) throw OutputError("the checkpoint does not fit the case: it has other stages");
    wall_begin_ = process_begin_ - wall_seconds_;
    kept_step_ = sim_->step();
    return index;
  } catch (const nlohmann::json::exception& error) {
    throw OutputError(std::string("the checkpoint does not fit this version of platen: ") + error.what());
  }
}

Experiment::Course Experiment::go_on_with_stage(Stand& stand, Stage& stage) {
  Course course;
  double elapsed = 0.0;
  try {
    fields::Reader reader{kept_.at("stage")};
    each_field(reader, stand, stage, course, elapsed);
  } catch (const nlohmann::json::exception& error) {
    throw OutputError(std::string("the checkpoint does not fit this version of platen: ") + error.what());
  }
  course.begun = wall_clock() - elapsed;
  return course;
}

CheckpointFacts facts_of(const Checkpoint& checkpoint) try {
  const nlohmann::json experiment = nlohmann::json::parse(checkpoint.experiment);
  CheckpointFacts facts;
  facts.rows = experiment.at("rows").get<std::size_t>();
  fields::from_json(experiment.at("frames"), facts.frames);
  facts.stage = experiment.at("stage").at("index").get<std::size_t>();
  facts.within = experiment.at("stage_open").get<bool>();
  fields::from_json(experiment.at("closed"), facts.closed);
  return facts;
} catch (const nlohmann::json::exception& error) {
  throw OutputError(std::string("the checkpoint does not fit this version of platen: ") + error.what());
}

}  // namespace platen
