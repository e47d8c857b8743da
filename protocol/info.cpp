#include "protocol/info.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "protocol/case_file.h"
#include "protocol/experiment.h"
#include "protocol/info_case.h"
#include "protocol/output.h"
#include "protocol/output/files.h"
#include "protocol/output/hdf5_file.h"
#include "protocol/output/results_h5.h"
#include "protocol/output/series_csv.h"
#include "protocol/output/stage_table.h"

namespace platen {

namespace fs = std::filesystem;

namespace {

using Json = nlohmann::ordered_json;

std::string to_line(const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n'; }

// ---- HDF5 files -----------------------------------------------------------------------------------------------------

struct DatasetLine {
  std::string path, type, unit, description;
  std::vector<std::uint64_t> shape;
};

void collect(const Hdf5Group& group, const std::string& path, std::vector<DatasetLine>& list) {
  for (const std::string& name : group.names()) {
    if (group.is_group(name)) {
      collect(group.group(name), path + name + "/", list);
      continue;
    }
    const Hdf5Shape shape = group.shape(name);
    list.push_back({path + name, shape.type, group.text_attribute(name, "unit"),
                    group.text_attribute(name, "description"), shape.size});
  }
}

std::string describe_hdf5(const fs::path& path, bool json) {
  const Hdf5File file = Hdf5File::open(path);
  const Hdf5Group root = file.root();
  std::vector<DatasetLine> list;
  collect(root, "/", list);
  const bool ours = root.has("provenance");
  const std::string title = ours ? root.text_attribute("provenance", "title") : "";
  const std::string version = ours ? root.text_attribute("provenance", "version") : "";
  if (json) {
    Json result = {{"kind", "hdf5"}, {"file", path.string()}};
    if (ours) result.update({{"title", title}, {"version", version}});
    result["datasets"] = Json::array();
    for (const DatasetLine& d : list)
      result["datasets"].push_back(
          {{"path", d.path}, {"shape", d.shape}, {"type", d.type}, {"unit", d.unit}, {"description", d.description}});
    return to_line(result);
  }
  std::string text = path.string() + "\n";
  if (ours) text += fmt::format("title    {}\nversion  platen {}\n", title, version);
  std::vector<std::string> shapes;
  std::size_t path_width = 0, shape_width = 0;
  for (const DatasetLine& d : list) {
    shapes.push_back(d.shape.empty() ? "1" : fmt::format("{}", fmt::join(d.shape, " x ")));
    path_width = std::max(path_width, d.path.size());
    shape_width = std::max(shape_width, shapes.back().size());
  }
  for (std::size_t i = 0; i < list.size(); ++i)
    text += fmt::format("{:<{}}  {:>{}}  {:<7}  [{}]  {}\n", list[i].path, path_width, shapes[i], shape_width,
                        list[i].type, list[i].unit, list[i].description);
  return text;
}

// ---- run folders ----------------------------------------------------------------------------------------------------

double number(const Json& object, const char* key) { return object.value(key, StageLine::none); }

std::vector<StageLine> lines_of_summary(const Json& summary) {
  std::vector<StageLine> lines;
  for (const Json& stage : summary.at("stages")) {
    const Json& values = stage.at("values");
    StageLine line;
    line.name = stage.at("name");
    line.end_reason = stage.at("end_reason");
    line.time = number(stage, "time");
    line.stress_top = number(values, "stress_top");
    line.strain = number(values, "strain");
    line.porosity = number(values, "porosity");
    line.coordination_number = number(values, "coordination_number");
    line.strength = number(stage, "strength");
    line.strength_strain = number(stage, "strength_strain");
    line.initial_stiffness = number(stage, "initial_stiffness");
    line.peak_found = stage.value("peak_found", false);
    line.warnings = stage.at("warnings").get<std::vector<std::string>>();
    lines.push_back(std::move(line));
  }
  return lines;
}

// Of a run that has not finished: the series up to now, and the reasons of the stages that are closed.
std::vector<StageLine> lines_of_series(const fs::path& folder) {
  const SeriesTable series = read_series(folder / "series.csv");
  std::vector<std::string> reasons(series.stage_names.size(), "not ended");
  if (fs::exists(folder / "results.h5")) {
    const Hdf5File file = Hdf5File::open(folder / "results.h5");
    const Hdf5Group stages = file.root().group("stages");
    for (std::size_t s = 0; s < reasons.size(); ++s) {
      const std::string name = stage_group_name(series.stage_names[s]);
      if (stages.has(name)) reasons[s] = stages.text_attribute(name, "end_reason");
    }
  }
  std::vector<StageLine> lines;
  for (std::size_t row = 0; row < series.rows(); ++row) {
    const auto stage = static_cast<std::size_t>(series.stage[row]);
    const bool first = row == 0 || series.stage[row - 1] != series.stage[row];
    if (first) {
      lines.emplace_back();
      lines.back().name = series.stage_names[stage];
      lines.back().end_reason = reasons[stage];
    }
    const bool last = row + 1 == series.rows() || series.stage[row + 1] != series.stage[row];
    if (first) lines.back().time = -series.column("time")[row];
    if (!last) continue;
    StageLine& line = lines.back();
    line.time += series.column("time")[row];
    line.stress_top = series.column("stress_top")[row];
    line.strain = series.column("strain")[row];
    line.porosity = series.column("porosity")[row];
    line.coordination_number = series.column("coordination_number")[row];
  }
  return lines;
}

Json read_summary(const fs::path& file) {
  try {
    return Json::parse(read_whole_file(file));
  } catch (const Json::exception& error) {
    throw OutputError(file.string() + ": " + error.what());
  }
}

// "done", "stopped by request (exit code 75)", "done up to fill, 5 more stages were not asked for".
std::string state_of(const Json& summary, const fs::path& case_file) {
  const int code = summary.at("exit_code").get<int>();
  if (code != exit_done) return fmt::format("{} (exit code {})", code == exit_stopped ? "stopped by request" : code == exit_goal ? "a stage missed its goal" : "failed", code);
  const Json& stages = summary.at("stages");
  std::size_t planned = stages.size();
  try {
    planned = read_case(case_file, {}, CaseUse::resume).stages.size();
  } catch (const CaseError&) {  // of another version: what it planned is not known
  }
  if (planned <= stages.size() || stages.empty()) return "done (exit code 0)";
  return fmt::format("done up to {} (exit code 0); {} more stage{} of the case not asked for", stages.back().at("name").get<std::string>(), planned - stages.size(),
                     planned - stages.size() == 1 ? "" : "s");
}

std::string describe_run(const fs::path& folder, bool json) {
  const std::string title = run_title(folder);
  const bool finished = fs::exists(folder / "summary.json");
  if (!finished) {
    const std::vector<StageLine> lines = lines_of_series(folder);
    if (!json) return fmt::format("run      {}\ntitle    {}\nstate    {}\n\n{}", folder.string(), title,
                                  run_state(folder).text, stage_table(lines));
    Json result = {{"kind", "run"}, {"folder", folder.string()}, {"title", title}, {"finished", false}};
    result["stages"] = Json::array();
    for (const StageLine& line : lines) {
      Json values = Json::object();
      const auto set = [&](const char* key, double value) {
        if (std::isfinite(value)) values[key] = value;
      };
      set("stress_top", line.stress_top);
      set("strain", line.strain);
      set("porosity", line.porosity);
      set("coordination_number", line.coordination_number);
      result["stages"].push_back(
          {{"name", line.name}, {"end_reason", line.end_reason}, {"time", line.time}, {"values", values}});
    }
    return to_line(result);
  }
  const Json summary = read_summary(folder / "summary.json");
  if (json) {
    Json result = {{"kind", "run"}, {"folder", folder.string()}, {"title", title}, {"finished", true}};
    result.update(summary);
    return to_line(result);
  }
  try {
    return fmt::format("run      {}\ntitle    {}\nversion  platen {}\nstate    {}\nhash     {}\n\n{}",
                       folder.string(), title, summary.at("version").get<std::string>(), run_state(folder).text, summary.value("state_hash", "none"),
                       stage_table(lines_of_summary(summary)));
  } catch (const Json::exception& error) {
    throw OutputError((folder / "summary.json").string() + ": " + error.what());
  }
}

}  // namespace

RunState run_state(const fs::path& folder) {
  if (!fs::exists(folder / "summary.json")) {
    const bool running = RunFolder::in_use(folder);
    return {running ? "running" : "not finished, and nobody works on it: it was killed", running};
  }
  const Json summary = read_summary(folder / "summary.json");
  try {
    return {state_of(summary, folder / "case.toml"), summary.at("exit_code").get<int>() == exit_done};
  } catch (const Json::exception& error) {
    throw OutputError((folder / "summary.json").string() + ": " + error.what());
  }
}

// The title alone: particle files that the case names may be elsewhere by now.
std::string run_title(const fs::path& folder) {
  const fs::path case_file = folder / "case.toml";
  try {
    const toml::table table = toml::parse(read_whole_file(case_file));
    return table["case"]["title"].value_or(std::string());
  } catch (const toml::parse_error& error) {
    throw OutputError(case_file.string() + ": " + std::string(error.description()));
  }
}

std::string describe(const fs::path& path, bool json) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) throw OutputError(path.string() + ": no such file or folder");
  if (fs::is_directory(path)) {
    if (fs::exists(path / "case.toml") && fs::exists(path / "series.csv")) return describe_run(path, json);
    if (fs::exists(path / "study.toml") && fs::exists(path / "runs.csv"))
      throw OutputError(path.string() + ": is the folder of a study; its tables are runs.csv and tables/*.csv, its runs are in runs/");
    throw OutputError(path.string() + ": is not a run folder");
  }
  if (Hdf5File::is_hdf5(path)) return describe_hdf5(path, json);
  if (path.extension() == ".toml") {
    const Case c = read_case(path);
    return json ? to_line(case_json_summary(c)) : case_text_summary(c);
  }
  throw OutputError(path.string() + ": is neither a run folder, an HDF5 file nor a case file (.toml)");
}

}  // namespace platen
