#include "protocol/study/porosity_match.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "protocol/case_document.h"
#include "protocol/case_overrides.h"
#include "protocol/experiment.h"
#include "protocol/output/files.h"
#include "protocol/scaling.h"
#include "protocol/study/runner.h"
#include "protocol/study/settled_sample.h"

namespace platen {
namespace {

namespace fs = std::filesystem;

constexpr double growth_unit = 1e-5;        // far below any tolerance of use
constexpr double growth_reach = 0.05;       // of porosity, to both sides, where no range is given
constexpr std::int64_t vibration_reach = 4;  // times the case's own duration, likewise
// Cohesionless spheres lose 0.03 of porosity in the first 120 periods of the shipped case: 0.006 a factor of e.
constexpr double vibration_slope = -0.006;

bool vibrates(const PorosityMatch& match) { return match.adjust == PorosityMatch::Adjust::vibration; }

// Whole swings of the bottom plate, as the stage counts them.
std::int64_t periods(const StageSpec& stage) {
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::floor(stage.frequency * *stage.duration * (1.0 + 1e-12))));
}

// The stages before the compression that are adjusted, one at least.
std::vector<const StageSpec*> adjusted_stages(const PorosityMatch& match, const Case& c) {
  const StageSpec* const settled = settled_stage(c);
  if (settled == nullptr)
    throw CaseError("there is no sample to match; allowed: cases with a compress stage that is not the first");
  if (c.output.slabs < 3)
    throw CaseError("porosity is compared without the lowest and the highest slab; allowed: output.slabs of at least 3");
  std::vector<const StageSpec*> out;
  for (const StageSpec* stage = c.stages.data(); stage <= settled; ++stage) {
    const bool grows = stage->kind == StageKind::fill && stage->method == FillMethod::grow;
    if (vibrates(match) ? stage->kind == StageKind::vibrate : grows) out.push_back(stage);
  }
  if (out.empty())
    throw CaseError(vibrates(match) ? "there is no vibration to adjust; allowed: cases with a vibrate stage before compress"
                                    : "there is no growth to adjust; allowed: cases with a fill stage of method \"grow\"");
  return out;
}

std::string key_of(const PorosityMatch& match, const StageSpec& stage) {
  return fmt::format("stage.{}.{}", stage.name, vibrates(match) ? "duration" : "porosity");
}

std::string value_text(const PorosityMatch& match, double value) {
  return vibrates(match) ? fmt::format("{:.4g} s", value) : fmt::format("{:.5g}", value);
}

bool holds_case(const fs::path& folder, const Case& c) {
  std::error_code ignored;
  return fs::is_regular_file(folder / "case.toml", ignored) && read_whole_file(folder / "case.toml") == c.text;
}

// The settled porosity of a run folder that holds this case, also of a run that is under way; not of one that should be reproducible and is not.
std::optional<double> porosity_in(const fs::path& folder, const Case& c, bool reproducible) try {
  std::error_code ignored;
  if (!holds_case(folder, c) || !fs::is_regular_file(folder / "results.h5", ignored)) return std::nullopt;
  const Hdf5Group results = Hdf5File::open(folder / "results.h5").root();
  if (reproducible && (!results.has("provenance") || results.integer_attribute("provenance", "reproducible", 0) == 0)) return std::nullopt;
  return settled_porosity(results, c);
} catch (const OutputError&) {
  return std::nullopt;  // a run that begins anew has just removed its files
}

// Growth gives up before the first stage on a bed that is too dense for it; every other failure is not an answer.
bool too_dense_to_grow(const PorosityMatch& match, const fs::path& folder, const Case& c, bool reproducible) {
  std::error_code ignored;
  if (vibrates(match) || !holds_case(folder, c) || !fs::is_regular_file(folder / "summary.json", ignored)) return false;
  const nlohmann::json summary = nlohmann::json::parse(read_whole_file(folder / "summary.json"), nullptr, false);
  return summary.is_object() && summary.value("exit_code", 0) == exit_numerical && (!reproducible || made_reproducibly(summary)) &&
         summary.value("stages", nlohmann::json::array()).empty();
}

// What the tries have reached, for people.
std::string failure(const PorosityMatch& match, const Case& start, const MatchState& state, SearchStep::Kind kind) {
  std::string text = fmt::format("porosity {:.4f} +- {:g} {}", *state.target, match.tolerance,
                                 kind == SearchStep::Kind::out_of_range ? "is out of reach" : "was not met");
  const std::string key = adjusted_key(match, start);
  double loosest = -1.0, densest = 2.0;
  std::int64_t least = state.tries.front().knob, most = least;
  for (const PorosityTry& one : state.tries) {
    least = std::min(least, one.knob), most = std::max(most, one.knob);
    if (one.porosity) loosest = std::max(loosest, *one.porosity), densest = std::min(densest, *one.porosity);
  }
  text += fmt::format(": {} tries with {} from {} to {}", state.tries.size(), key,
                      value_text(match, knob_value(match, start, least)), value_text(match, knob_value(match, start, most)));
  if (state.knob == 0) return text + " made no bed";
  text += fmt::format(" reached {:.4f} to {:.4f}", densest, loosest);
  if (kind == SearchStep::Kind::not_met)
    text += fmt::format("; nearest {}", value_text(match, knob_value(match, start, state.knob)));
  return text;
}

}  // namespace

std::string adjusted_key(const PorosityMatch& match, const Case& c) {
  return key_of(match, *adjusted_stages(match, c).front());
}

PorosityKnob knob_of(const PorosityMatch& match, const Case& start) {
  const StageSpec& stage = *adjusted_stages(match, start).front();
  PorosityKnob knob;
  if (vibrates(match)) {
    knob.start = periods(stage);
    knob.high = vibration_reach * knob.start;
    knob.slope = vibration_slope;
    if (match.range) {
      knob.low = std::max<std::int64_t>(1, std::llround(std::ceil(stage.frequency * match.range->first * (1.0 - 1e-12))));
      knob.high = std::llround(std::floor(stage.frequency * match.range->second * (1.0 + 1e-12)));
    }
  } else {
    const double own = *stage.porosity;
    const auto [low, high] = match.range.value_or(std::pair(own - growth_reach, own + growth_reach));
    knob.start = std::llround(own / growth_unit);
    knob.low = std::max<std::int64_t>(1, std::llround(low / growth_unit));
    knob.high = std::min<std::int64_t>(std::llround(1.0 / growth_unit) - 1, std::llround(high / growth_unit));
    knob.slope = own;  // as if the bed settled at the porosity that it was grown to
  }
  if (knob.high < knob.low)
    throw CaseError(fmt::format("match_porosity.range holds no setting of {}; allowed: a wider range{}", key_of(match, stage),
                                vibrates(match) ? fmt::format(", at least one whole period of {:g} Hz", stage.frequency) : ""));
  knob.start = std::clamp(knob.start, knob.low, knob.high);
  with_knob(match, start, knob.low);
  const Case longest = with_knob(match, start, knob.high);
  for (const StageSpec* const one : adjusted_stages(match, longest))
    if (vibrates(match) && *one->duration > one->max_duration)
      throw CaseError(fmt::format("stage.{}.max_duration is {:g} s, match_porosity wants up to {:g} s; allowed: a larger max_duration, or a shorter range",
                                  one->name, one->max_duration, *one->duration));
  return knob;
}

double knob_value(const PorosityMatch& match, const Case& start, std::int64_t knob) {
  const auto setting = static_cast<double>(knob);
  return vibrates(match) ? setting / adjusted_stages(match, start).front()->frequency : setting / std::round(1.0 / growth_unit);
}

Case with_knob(const PorosityMatch& match, const Case& start, std::int64_t knob) {
  Problems problems;
  CaseValue root = parse_document(start.text, "case.toml");
  const std::vector<const StageSpec*> stages = adjusted_stages(match, start);
  for (const StageSpec* const stage : stages) {
    double value = knob_value(match, start, knob);
    if (vibrates(match) && stage != stages.front()) {
      const double ratio = static_cast<double>(periods(*stage)) / static_cast<double>(periods(*stages.front()));
      value = std::max(1.0, std::round(ratio * static_cast<double>(knob))) / stage->frequency;
    }
    apply_override(root, key_of(match, *stage) + "=" + toml_number(value), problems);
  }
  if (!problems.empty()) throw CaseError(problems.text());
  return parse_case(to_toml(root), start.file.string(), {});
}

fs::path try_folder(const fs::path& study_folder, const Job& job, std::size_t number) {
  return study_folder / "tries" / job.name / std::to_string(number);
}

MatchState match_state(const StudyPlan& plan, const Job& job, const fs::path& study_folder) {
  const PorosityMatch& match = *job.match->settings;
  const Case& start = job.match->start;
  const Job& reference = plan.jobs[job.match->reference];
  MatchState state;
  state.target = porosity_in(run_folder(study_folder, reference), reference.c, reference.reproducible);
  if (!state.target) return state;
  const PorosityKnob knob = knob_of(match, start);
  const PorosityAim aim{*state.target, match.tolerance, match.most_tries};
  for (;;) {
    const SearchStep step = next_step(knob, aim, state.tries);
    state.knob = step.knob;
    if (step.kind == SearchStep::Kind::out_of_range || step.kind == SearchStep::Kind::not_met) {
      state.kind = MatchState::Kind::failed;
      state.message = failure(match, start, state, step.kind);
      return state;
    }
    state.c = with_knob(match, start, step.knob);
    state.kind = step.kind == SearchStep::Kind::met ? MatchState::Kind::met : MatchState::Kind::attempt;
    if (state.kind == MatchState::Kind::met) return state;
    const fs::path folder = try_folder(study_folder, job, state.tries.size() + 1);
    const std::optional<double> porosity = porosity_in(folder, state.c, job.reproducible);
    if (!porosity && !too_dense_to_grow(match, folder, state.c, job.reproducible)) return state;
    state.tries.push_back({step.knob, porosity});
  }
}

void take_match(Job& job, const MatchState& state) {
  if (state.kind != MatchState::Kind::met) return;
  job.c = state.c;
  job.match->met = true;
}

}  // namespace platen
