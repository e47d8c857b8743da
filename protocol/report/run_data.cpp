#include "protocol/report/run_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "protocol/case_file.h"
#include "protocol/info.h"
#include "protocol/output/files.h"
#include "protocol/output/hdf5_file.h"
#include "protocol/output/results_h5.h"
#include "protocol/output/series_csv.h"

namespace platen {

namespace fs = std::filesystem;

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t most_rows = 4000, least_rows = 300;  // of the series that a page carries, of a stage at least: what a plot can show
constexpr std::size_t most_spheres = 150000;  // in all beds together, some 3 MB of the page

// Six digits, as many as a plot can show: a third of the size of the page.
Json rounded(double x) { return std::isfinite(x) ? Json(std::strtod(fmt::format("{:.6g}", x).c_str(), nullptr)) : Json(); }

Json parsed(const fs::path& file) {
  try {
    return Json::parse(read_whole_file(file));
  } catch (const Json::exception& error) {
    throw OutputError(file.string() + ": " + error.what());
  }
}

// The case, where it still reads.
std::optional<Case> case_of(const fs::path& folder) {
  try {
    return read_case(folder / "case.toml", {}, CaseUse::resume);
  } catch (const CaseError&) {
    return std::nullopt;
  }
}

// Of a run without a summary: its stages as far as it got, by the groups of results.h5 and the rows of the series.
Json stages_so_far(const SeriesTable& series, const Hdf5Group* closed, const std::optional<Case>& c) {
  Json stages = Json::array();
  for (std::size_t s = 0; s < series.stage_names.size(); ++s) {
    const auto first = std::find(series.stage.begin(), series.stage.end(), static_cast<int>(s)) - series.stage.begin();
    const auto last = static_cast<std::ptrdiff_t>(series.rows()) - (std::find(series.stage.rbegin(), series.stage.rend(), static_cast<int>(s)) - series.stage.rbegin()) - 1;
    if (last < first) continue;
    const auto a = static_cast<std::size_t>(first), b = static_cast<std::size_t>(last);
    Json stage = {{"name", series.stage_names[s]}, {"kind", series.stage_names[s]}, {"end_reason", "not ended"}, {"warnings", Json::array()}};
    const std::string group = stage_group_name(series.stage_names[s]);
    if (c)
      for (const StageSpec& spec : c->stages)
        if (spec.name == series.stage_names[s]) stage["kind"] = to_string(spec.kind);
    // A stage that was stopped and goes on is in results.h5 as it was then.
    const bool ended = b + 1 < series.rows() || (closed && closed->has(group) && static_cast<double>(closed->integer_attribute(group, "last_step", -1)) == series.column("step")[b]);
    if (closed && closed->has(group) && ended) stage["kind"] = closed->text_attribute(group, "kind"), stage["end_reason"] = closed->text_attribute(group, "end_reason");
    stage["time"] = series.column("time")[b] - series.column("time")[a];
    stage["steps"] = series.column("step")[b] - series.column("step")[a];
    for (std::size_t k = 0; k < series.columns.size(); ++k)
      if (b < series.columns[k].size() && std::isfinite(series.columns[k][b])) stage["values"][series_columns()[k].name] = series.columns[k][b];
    stages.push_back(std::move(stage));
  }
  return stages;
}

// Rows that a plot needs: each stage gets its share, first and last among them, and of each group of neighbours those of the
// least and the largest stress, so that no peak is lost.
std::vector<std::size_t> shown_rows(const SeriesTable& series) {
  const std::vector<double>& stress = series.column("stress_top");
  std::vector<std::size_t> shown;
  for (std::size_t first = 0; first < series.rows();) {
    std::size_t end = first + 1;
    while (end < series.rows() && series.stage[end] == series.stage[first]) ++end;
    const std::size_t rows = end - first, share = std::max(least_rows, most_rows * rows / series.rows());
    const std::size_t group = rows <= share ? 1 : (2 * rows + share - 1) / share;
    shown.push_back(first);
    for (std::size_t k = first + 1; k + 1 < end; k += group) {
      const auto from = stress.begin() + static_cast<std::ptrdiff_t>(k), to = stress.begin() + static_cast<std::ptrdiff_t>(std::min(k + group, end - 1));
      const auto [least, largest] = std::minmax_element(from, to);
      const auto a = static_cast<std::size_t>(least - stress.begin()), b = static_cast<std::size_t>(largest - stress.begin());
      shown.push_back(std::min(a, b));
      if (a != b) shown.push_back(std::max(a, b));
    }
    if (end - 1 > first) shown.push_back(end - 1);
    first = end;
  }
  return shown;
}

Json series_data(const SeriesTable& series, const Json& stages, const std::vector<std::vector<double>>& whole_strain) {
  // Stages are numbered as in `stages`.
  std::map<int, int> number;
  for (std::size_t s = 0; s < stages.size(); ++s) {
    const auto at = std::find(series.stage_names.begin(), series.stage_names.end(), stages[s].at("name").get<std::string>());
    if (at != series.stage_names.end()) number[static_cast<int>(at - series.stage_names.begin())] = static_cast<int>(s);
  }
  const std::vector<std::size_t> rows = shown_rows(series);
  Json data;
  for (const std::size_t k : rows) data["stage"].push_back(number.contains(series.stage[k]) ? number[series.stage[k]] : -1);
  for (std::size_t c = 0; c < series.columns.size(); ++c) {
    const SeriesColumn& column = series_columns()[c];
    if (column.kind == SeriesColumn::Kind::stage || std::string_view(column.name) == "step") continue;
    const bool strain = std::string_view(column.name) == "strain" && !whole_strain.empty();
    Json values = Json::array();
    for (const std::size_t k : rows) values.push_back(rounded(strain && k < whole_strain[0].size() ? whole_strain[0][k] : series.columns[c][k]));
    data[column.name] = std::move(values);
  }
  return data;
}

// From the log: the step that was taken from each look on, and the limits found there, with the time that the series has for it.
Json limits_data(const fs::path& log, const SeriesTable& series) {
  Json limits = Json::array();
  if (!fs::exists(log) || series.rows() == 0) return limits;
  const std::vector<double>&steps = series.column("step"), &times = series.column("time");
  std::istringstream lines(read_whole_file(log));
  for (std::string line; std::getline(lines, line);) {
    const Json entry = Json::parse(line, nullptr, false);  // the last line of a run that was killed may be torn
    if (!entry.is_object() || !entry.contains("step") || !entry["step"].is_number()) continue;
    const std::string event = entry.value("event", "");
    if (event != "limits" && event != "start") continue;
    const double step = entry["step"].get<double>();
    const std::size_t above = std::min(static_cast<std::size_t>(std::upper_bound(steps.begin(), steps.end(), step) - steps.begin()), steps.size() - 1), below = above > 0 ? above - 1 : 0;
    const double share = steps[above] > steps[below] ? std::min(1.0, (step - steps[below]) / (steps[above] - steps[below])) : 0.0;
    // After an interruption the run came by here once more.
    while (!limits.empty() && limits.back()["step"].get<double>() >= step) limits.erase(limits.size() - 1);
    Json point = {{"step", step}, {"time", rounded(times[below] + share * (times[above] - times[below]))}};
    for (const char* key : {"dt", "dt_crit", "dt_limit"})
      if (entry.contains(key) && entry[key].is_number()) point[key] = rounded(entry[key].get<double>());
    limits.push_back(std::move(point));
  }
  if (!limits.empty()) limits.push_back({{"step", steps.back()}, {"time", rounded(times.back())}, {"dt", limits.back()["dt"]}});
  return limits;
}

void add_profiles(Json& data, const Hdf5Group& root) {
  if (!root.has("profiles")) return;
  const Hdf5Group profiles = root.group("profiles");
  for (Json& stage : data["stages"]) {
    const std::string name = stage_group_name(stage.at("name").get<std::string>());
    if (!profiles.has(name)) continue;
    const Hdf5Group profile = profiles.group(name);
    for (const std::string& column : profile.names())
      for (const double x : profile.read<double>(column)) stage["profile"][column].push_back(rounded(x));
  }
}

std::vector<int> in_units(const std::vector<double>& lengths, double unit) {
  std::vector<int> whole;
  for (const double x : lengths) whole.push_back(static_cast<int>(std::lround(std::clamp(x / unit, -1e9, 1e9))));
  return whole;
}

// Positions in thousandths of the largest radius, whole numbers: nobody sees less.
void add_beds(Json& data, const Hdf5Group& root, const std::optional<Case>& c) {
  data["beds"] = Json::array();
  if (!root.has("stages")) return;
  const Hdf5Group stages = root.group("stages");
  std::vector<std::string> names;  // in the order of the run
  for (const Json& stage : data["stages"])
    if (const std::string name = stage.at("name").get<std::string>(); stages.has(stage_group_name(name)) && stages.group(stage_group_name(name)).has("particles")) names.push_back(name);
  if (names.empty()) return;
  const auto particles = [&](const std::string& stage) { return stages.group(stage_group_name(stage)).group("particles"); };
  const std::vector<double> radius = particles(names.back()).read<double>("radius");
  const std::size_t n = radius.size();
  if (n == 0) return;
  const auto [smallest, largest] = std::minmax_element(radius.begin(), radius.end());
  const double unit = 1e-3 * *largest;
  data["particles"] = {{"count", n}, {"unit", unit}, {"radius", *smallest == *largest ? std::vector<int>{1000} : in_units(radius, unit)}};
  // Where all beds are too much for a page: the last ones, and that from which loading starts.
  if (n > most_spheres) return;
  const std::size_t room = std::max<std::size_t>(1, most_spheres / n);
  if (names.size() > room) {
    std::vector<std::string> kept(names.end() - static_cast<std::ptrdiff_t>(room), names.end());
    for (std::size_t s = 0; s + 1 < data["stages"].size(); ++s)
      if (const std::string before = data["stages"][s].at("name"); room > 1 && data["stages"][s + 1].at("kind") == "compress" && std::find(kept.begin(), kept.end(), before) == kept.end() &&
                                                                    std::find(names.begin(), names.end(), before) != names.end()) {
        kept.front() = before;
        break;
      }
    names = kept;
  }
  std::vector<double> last;
  std::string before;
  for (const std::string& name : names) {
    const Hdf5Group group = particles(name);
    std::vector<double> x = group.read<double>("position");
    Json bed = {{"stage", name}, {"position", in_units(x, unit)}};
    // Where they would be without the box around them: a way through a periodic side is no jump.
    if (const auto image = group.read<std::int32_t>("image"); c)
      for (std::size_t k = 0; k < n; ++k) x[3 * k] += image[2 * k] * c->box.width, x[3 * k + 1] += image[2 * k + 1] * c->box.depth;
    if (last.size() == x.size()) {
      std::vector<double> way;
      for (std::size_t k = 0; k < n; ++k) way.push_back(std::hypot(x[3 * k] - last[3 * k], x[3 * k + 1] - last[3 * k + 1], x[3 * k + 2] - last[3 * k + 2]));
      bed["moved"] = in_units(way, unit), bed["since"] = before;
    }
    last = std::move(x), before = name;
    data["beds"].push_back(std::move(bed));
  }
}

}  // namespace

Json run_data(const fs::path& folder) {
  if (!fs::exists(folder / "case.toml") || !fs::exists(folder / "series.csv")) throw OutputError(folder.string() + ": is not a run folder");
  const RunState state = run_state(folder);
  const fs::path whole = fs::weakly_canonical(folder);
  Json data = {{"name", whole.filename().string()}, {"title", run_title(folder)}, {"folder", folder.string()}, {"state", state.text}, {"good", state.good}};
  data["case"] = read_whole_file(folder / "case.toml");
  const SeriesTable series = read_series(folder / "series.csv");
  std::optional<Hdf5File> file;
  if (fs::exists(folder / "results.h5")) file.emplace(Hdf5File::open(folder / "results.h5"));
  std::optional<Hdf5Group> root, closed;
  if (file) root.emplace(file->root());
  if (root && root->has("stages")) closed.emplace(root->group("stages"));
  if (fs::exists(folder / "summary.json")) {
    const Json summary = parsed(folder / "summary.json");
    for (const char* key : {"state_hash", "version", "performance", "stages"})
      if (summary.contains(key)) data[key] = summary.at(key);
  }
  const std::optional<Case> c = case_of(folder);
  if (!data.contains("stages")) data["stages"] = stages_so_far(series, closed ? &*closed : nullptr, c);
  for (Json& stage : data["stages"])
    if (!stage.contains("values")) stage["values"] = Json::object();
  // The series knows strain from its zero on, results.h5 for whole stages.
  std::vector<std::vector<double>> strain;
  if (root && root->has("series") && root->group("series").has("strain")) strain.push_back(root->group("series").read<double>("strain"));
  data["series"] = series_data(series, data["stages"], strain);
  data["limits"] = limits_data(folder / "log.jsonl", series);
  data["beds"] = Json::array();
  if (root) add_profiles(data, *root), add_beds(data, *root, c);
  return data;
}

}  // namespace platen
