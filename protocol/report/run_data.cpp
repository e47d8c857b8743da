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

#include "protocol/info.h"
#include "protocol/output/files.h"
#include "protocol/output/hdf5_file.h"
#include "protocol/output/results_h5.h"
#include "protocol/output/series_csv.h"

namespace platen {

namespace fs = std::filesystem;

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t most_rows = 4000;       // of the series that a page carries: what a plot can show
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

// Of a run without a summary: its stages as far as it got, by the groups of results.h5 and the rows of the series.
Json stages_so_far(const SeriesTable& series, const Hdf5Group* closed) {
  Json stages = Json::array();
  for (std::size_t s = 0; s < series.stage_names.size(); ++s) {
    const auto first = std::find(series.stage.begin(), series.stage.end(), static_cast<int>(s)) - series.stage.begin();
    const auto last = static_cast<std::ptrdiff_t>(series.rows()) - (std::find(series.stage.rbegin(), series.stage.rend(), static_cast<int>(s)) - series.stage.rbegin()) - 1;
    if (last < first) continue;
    const auto a = static_cast<std::size_t>(first), b = static_cast<std::size_t>(last);
    Json stage = {{"name", series.stage_names[s]}, {"kind", series.stage_names[s]}, {"end_reason", "not ended"}, {"warnings", Json::array()}};
    const std::string group = stage_group_name(series.stage_names[s]);
    if (closed && closed->has(group)) stage["kind"] = closed->text_attribute(group, "kind"), stage["end_reason"] = closed->text_attribute(group, "end_reason");
    stage["time"] = series.column("time")[b] - series.column("time")[a];
    stage["steps"] = series.column("step")[b] - series.column("step")[a];
    for (std::size_t c = 0; c < series.columns.size(); ++c)
      if (b < series.columns[c].size() && std::isfinite(series.columns[c][b])) stage["values"][series_columns()[c].name] = series.columns[c][b];
    stages.push_back(std::move(stage));
  }
  return stages;
}

// Rows that are thinned evenly within a stage, its first and last one always among them.
std::vector<std::size_t> shown_rows(const SeriesTable& series) {
  const std::size_t every = series.rows() / most_rows + 1;
  std::vector<std::size_t> shown;
  std::size_t since = 0;
  for (std::size_t k = 0; k < series.rows(); ++k) {
    const bool first = k == 0 || series.stage[k - 1] != series.stage[k], last = k + 1 == series.rows() || series.stage[k + 1] != series.stage[k];
    since = first ? 0 : since + 1;
    if (last || since % every == 0) shown.push_back(k);
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

// From the log: the step and its limits, with the time that the series has for their step.
Json limits_data(const fs::path& log, const SeriesTable& series) {
  Json limits = Json::array();
  if (!fs::exists(log) || series.rows() == 0) return limits;
  const std::vector<double>&steps = series.column("step"), &times = series.column("time");
  std::istringstream lines(read_whole_file(log));
  for (std::string line; std::getline(lines, line);) {
    const Json entry = Json::parse(line, nullptr, false);  // the last line of a run that was killed may be torn
    if (!entry.is_object() || entry.value("event", "") != "limits") continue;
    const double step = entry.value("step", 0.0);
    const std::size_t above = std::min(static_cast<std::size_t>(std::upper_bound(steps.begin(), steps.end(), step) - steps.begin()), steps.size() - 1), below = above > 0 ? above - 1 : 0;
    const double share = steps[above] > steps[below] ? std::min(1.0, (step - steps[below]) / (steps[above] - steps[below])) : 0.0;
    // After an interruption the run came by here once more.
    while (!limits.empty() && limits.back()["step"].get<double>() >= step) limits.erase(limits.size() - 1);
    Json point = {{"step", step}, {"time", rounded(times[below] + share * (times[above] - times[below]))}};
    for (const char* key : {"dt", "dt_crit", "dt_limit"})
      if (entry.contains(key) && entry[key].is_number()) point[key] = rounded(entry[key].get<double>());
    limits.push_back(std::move(point));
  }
  return limits;
}

Json profiles_data(const Hdf5Group& root) {
  Json data = Json::object();
  if (!root.has("profiles")) return data;
  const Hdf5Group profiles = root.group("profiles");
  for (const std::string& stage : profiles.names()) {
    const Hdf5Group profile = profiles.group(stage);
    for (const std::string& name : profile.names())
      for (const double x : profile.read<double>(name)) data[stage][name].push_back(rounded(x));
  }
  return data;
}

std::vector<int> in_units(const std::vector<double>& lengths, double unit) {
  std::vector<int> whole;
  for (const double x : lengths) whole.push_back(static_cast<int>(std::lround(std::clamp(x / unit, -1e9, 1e9))));
  return whole;
}

// Positions in thousandths of the largest radius, whole numbers: nobody sees less.
void add_beds(Json& data, const Hdf5Group& root) {
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
  for (const std::string& name : names) {
    const Hdf5Group group = particles(name);
    const std::vector<double> x = group.read<double>("position");
    Json bed = {{"stage", name}, {"position", in_units(x, unit)}};
    if (last.size() == x.size()) {
      // How far a sphere came; a jump over a periodic side is none (the way across a half of the box is not a grain's way).
      std::vector<double> span(3, 0.0);
      for (std::size_t k = 0; k < x.size(); ++k) span[k % 3] = std::max(span[k % 3], x[k]);
      std::vector<double> way;
      for (std::size_t k = 0; k < n; ++k) {
        double square = 0.0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          double d = std::fabs(x[3 * k + axis] - last[3 * k + axis]);
          if (axis < 2 && d > 0.5 * span[axis]) d = std::fabs(span[axis] - d);
          square += d * d;
        }
        way.push_back(std::sqrt(square));
      }
      bed["moved"] = in_units(way, unit);
    }
    last = x;
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
  if (!data.contains("stages")) data["stages"] = stages_so_far(series, closed ? &*closed : nullptr);
  for (Json& stage : data["stages"])
    if (!stage.contains("values")) stage["values"] = Json::object();
  // The series knows strain from its zero on, results.h5 for whole stages.
  std::vector<std::vector<double>> strain;
  if (root && root->has("series") && root->group("series").has("strain")) strain.push_back(root->group("series").read<double>("strain"));
  data["series"] = series_data(series, data["stages"], strain);
  data["limits"] = limits_data(folder / "log.jsonl", series);
  data["profiles"] = root ? profiles_data(*root) : Json::object();
  data["beds"] = Json::array();
  if (root) add_beds(data, *root);
  return data;
}

}  // namespace platen
