#include "protocol/output/summary_json.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "protocol/output/series_csv.h"

namespace platen {

namespace {

using Json = nlohmann::ordered_json;

// JSON knows neither NaN nor infinity: what has no value has no key.
void set(Json& object, const char* key, std::optional<double> value) {
  if (value && std::isfinite(*value)) object[key] = *value;
}

Json values_of(const StageResult& stage) {
  SeriesRow row = stage.last;
  if (stage.strain_zero_height) row.strain = engineering_strain(*stage.strain_zero_height, row.measures.height);
  Json values = Json::object();
  for (const SeriesColumn& column : series_columns()) {
    if (column.kind == SeriesColumn::Kind::stage) values[column.name] = stage.name;
    else if (column.kind == SeriesColumn::Kind::count)
      values[column.name] = static_cast<std::int64_t>(column.value(row));
    else set(values, column.name, column.value(row));
  }
  return values;
}

double rate(std::int64_t count, double seconds) {
  return seconds > 0.0 ? static_cast<double>(count) / seconds : std::nan("");
}

Json stage_json(const StageResult& s) {
  const std::int64_t steps = s.last_step - s.first_step;
  Json stage = {{"name", s.name},
                {"kind", to_string(s.kind)},
                {"end_reason", s.end_reason},
                {"steps", steps},
                {"time", s.time_end - s.time_begin}};
  set(stage, "particle_steps_per_second", rate(steps * s.particles, s.wall_seconds));
  stage["values"] = values_of(s);
  set(stage, "strength", s.strength);
  set(stage, "strength_strain", s.strength_strain);
  set(stage, "initial_stiffness", s.initial_stiffness);
  if (s.peak_found) stage["peak_found"] = *s.peak_found;
  set(stage, "energy_residual", s.last.measures.energy_residual);
  set(stage, "energy_residual_share", s.residual_share);
  Json step = Json::object();
  if (s.time_step.largest > 0.0) set(step, "smallest", s.time_step.smallest), set(step, "largest", s.time_step.largest);
  set(step, "smallest_dt_crit", s.time_step.dt_crit), set(step, "smallest_dt_limit", s.time_step.dt_limit);
  if (s.time_step.largest_share > 0.0) set(step, "largest_over_dt_limit", s.time_step.largest_share);
  if (!s.time_step.ruled_by.empty()) step["ruled_by"] = s.time_step.ruled_by;
  if (!step.empty()) stage["time_step"] = step;
  if (s.bed) {
    const BedStress& b = *s.bed;
    stage["bed"] = {{"stress", b.stress}, {"pressure", b.pressure}, {"deviator", b.deviator},
                    {"principal", b.principal}, {"principal_direction", b.principal_direction}};
    const double upright = b.stress[2][2];
    if (upright > 0.0) set(stage["bed"], "lateral_stress_ratio", 0.5 * (b.stress[0][0] + b.stress[1][1]) / upright);
    if (b.pairs > 0) {
      stage["bed"]["fabric"] = b.fabric, stage["bed"]["fabric_deviator"] = b.fabric_deviator;
      stage["bed"]["mean_overlap"] = b.mean_overlap, stage["bed"]["largest_overlap"] = b.largest_overlap;
    }
  }
  stage["warnings"] = s.warnings;
  return stage;
}

}  // namespace

std::string summary_json(int exit_code, std::optional<std::uint64_t> state_hash, const Performance& performance,
                         const std::vector<StageResult>& stages) {
  Json summary = Json::object();
  if (state_hash) {
    char digits[17];
    std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(*state_hash));
    summary["state_hash"] = digits;
  }
  summary["version"] = PLATEN_VERSION;
  summary["exit_code"] = exit_code;
  summary["stages"] = Json::array();
  for (const StageResult& stage : stages) summary["stages"].push_back(stage_json(stage));
  Json& figures = summary["performance"];
  figures = {{"threads", performance.threads},
             {"instruction_set", performance.instruction_set},
             {"reproducible", performance.reproducible},
             {"scene", performance.scene},
             {"particle_steps", performance.particle_steps},
             {"wall_seconds", performance.wall_seconds},
             {"rebuilds", performance.rebuilds},
             {"prunes", performance.prunes},
             {"redone_steps", performance.redone_steps}};
  set(figures, "particle_steps_per_second", rate(performance.particle_steps, performance.wall_seconds));
  return summary.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

}  // namespace platen
