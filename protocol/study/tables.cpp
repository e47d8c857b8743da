#include "protocol/study/tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "protocol/output/files.h"
#include "protocol/output/hdf5_file.h"
#include "protocol/study/porosity_match.h"

namespace platen {
namespace {

namespace fs = std::filesystem;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// A cell; numbers read back to the same bits, what has no value is empty.
std::string cell(double value) { return std::isfinite(value) ? fmt::format("{:.17g}", value) : ""; }
std::string cell(const std::optional<double>& value) { return cell(value.value_or(nan)); }
std::string cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? "\"\"" : c == '\n' || c == '\r' ? " " : std::string(1, c);
  return out + '"';
}

std::string list(const std::vector<double>& values) {
  std::string out;
  for (const double v : values) out += (out.empty() ? "" : ";") + cell(v);
  return out;
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw OutputError(folder.string() + ": cannot write: " + error.message());
}

std::string curve_cells(const PlannedCurve& curve) {
  return fmt::format("{},{},{},{}", cell(curve.label), cell(curve.radius), cell(curve.powers.stiffness),
                     cell(curve.powers.adhesion));
}
constexpr const char* curve_header = "curve,radius [m],stiffness power [-],adhesion power [-]";

void write_curves(const fs::path& folder, const PartResults& part, const std::string& observable) {
  const ObservableKind& kind = observable_kind(observable);
  std::string text = fmt::format("{},seed,{} [{}],{} [{}],deviation [{}]\n", curve_header, kind.x_label, kind.x_unit,
                                 kind.y_label, kind.y_unit, kind.y_unit);
  bool any = false;
  for (const MeasuredCurve& curve : part.curves) {
    for (std::size_t k = 0; k < curve.runs.size(); ++k) {
      const auto found = curve.runs[k].curves.find(observable);
      if (found == curve.runs[k].curves.end()) continue;
      any = true;
      const Band band = band_of({found->second});
      for (std::size_t i = 0; i < band.x.size(); ++i)
        text += fmt::format("{},{},{},{},\n", curve_cells(*curve.planned), curve.seeds[k], cell(band.x[i]),
                            cell(band.mean[i]));
    }
    const std::vector<Curve> seeds = curve.curves(observable);
    if (seeds.size() < 2) continue;
    const Band band = band_of(seeds);
    for (std::size_t i = 0; i < band.x.size(); ++i)
      text += fmt::format("{},mean,{},{},{}\n", curve_cells(*curve.planned), cell(band.x[i]), cell(band.mean[i]),
                          cell(band.deviation[i]));
  }
  if (any) write_whole_file(folder / (observable + ".csv"), text);
}

void write_scalars(const fs::path& file, const PartResults& part) {
  std::string text =
      std::string(curve_header) + ",quantity,unit,seeds,mean,deviation,reference,over reference,values\n";
  for (const MeasuredCurve& curve : part.curves) {
    const MeasuredCurve& reference = part.curves[curve.planned->reference];
    for (const ScalarKind& kind : scalar_kinds()) {
      const std::vector<double> values = curve.values(kind.name), others = reference.values(kind.name);
      if (values.empty()) continue;
      const Spread spread = spread_of(values);
      const double against = others.empty() ? nan : spread_of(others).mean;
      text += fmt::format("{},{},{},{},{},{},{},{},{}\n", curve_cells(*curve.planned), kind.name, kind.unit,
                          spread.count, cell(spread.mean), cell(spread.deviation), cell(against),
                          cell(spread.mean / against), list(values));
    }
  }
  write_whole_file(file, text);
}

void write_collapse(const fs::path& file, const PartResults& part) {
  std::string text =
      std::string(curve_header) +
      ",against,observable,unit,seeds,error,scatter,of means,over range [-],over seed scatter [-],each\n";
  for (const CollapseRow& row : part.collapse) {
    const CollapseError& e = row.error;
    text += fmt::format("{},{},{},{},{},{},{},{},{},{},{}\n", curve_cells(*part.curves[row.curve].planned),
                        cell(part.curves[row.reference].planned->label), row.observable,
                        observable_kind(row.observable).y_unit, e.each.size(), cell(e.error), cell(e.scatter),
                        cell(e.of_means), cell(e.relative), cell(e.in_scatter), list(e.each));
  }
  write_whole_file(file, text);
}

const char* power_name(const ScanResult& scan) { return scan.power == ScanSpec::Power::stiffness ? "stiffness" : "adhesion"; }

void write_scans(const fs::path& file, const PartResults& part) {
  std::string text =
      "scanned power,radius [m],other power [-],observable,seeds,powers,errors over range [-],best "
      "tried,minimum,uncertainty,error at minimum,inside\n";
  for (const ScanResult& scan : part.scans) {
    const bool found = scan.minimum.has_value();
    text += fmt::format(
        "{},{},{},{},{},{},{},{},{},{},{},{}\n", power_name(scan),
        cell(scan.radius), cell(scan.other_power), scan.observable, scan.seeds, list(scan.powers), list(scan.errors),
        cell(scan.best_tried), found ? cell(scan.minimum->power) : "", found ? cell(scan.minimum->uncertainty) : "",
        found ? cell(scan.minimum->error) : "", found ? (scan.minimum->inside ? "yes" : "no") : "");
  }
  write_whole_file(file, text);
}

void write_timing(const fs::path& file, const StudyPlan& plan, const PartResults& part) {
  std::string text = std::string(curve_header) + ",run,spheres,threads,wall time [s],steal time [s]\n";
  for (const MeasuredCurve& curve : part.curves)
    for (std::size_t k = 0; k < curve.runs.size(); ++k) {
      const Job& job = plan.jobs[curve.jobs[k]];
      text += fmt::format("{},{},{},{},{},{}\n", curve_cells(*curve.planned), job.name, job.c.particles.count,
                          job.threads, cell(curve.wall_seconds[k]), cell(curve.steal_seconds[k]));
    }
  write_whole_file(file, text);
}

// How each porosity was matched, from the tries on disk.
void write_match(const fs::path& folder, const fs::path& file, const StudyPlan& plan, const PlannedPart& part) {
  const PorosityMatch& match = *part.study->match_porosity;
  std::string text = std::string(curve_header) + ",seed,run,matched to,wanted porosity [-],tolerance [-],met,porosity [-],key,value,tried values,their porosities [-]\n";
  for (const PlannedCurve& curve : part.curves)
    for (std::size_t k = 0; k < curve.jobs.size(); ++k) {
      const Job& job = plan.jobs[curve.jobs[k]];
      if (!job.match) continue;
      const MatchState state = match_state(plan, job, folder);
      std::vector<double> values, porosities;
      double value = nan, porosity = nan;
      for (const PorosityTry& one : state.tries) {
        values.push_back(knob_value(match, job.match->start, one.knob));
        porosities.push_back(one.porosity.value_or(nan));
        if (one.knob == state.knob) value = values.back(), porosity = porosities.back();
      }
      text += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\n", curve_cells(curve), curve.seeds[k], cell(job.name),
                          cell(plan.jobs[job.match->reference].name), cell(state.target), cell(match.tolerance),
                          job.match->met ? "yes" : "no", cell(porosity), cell(adjusted_key(match, job.match->start)), cell(value),
                          list(values), list(porosities));
    }
  write_whole_file(file, text);
}

// A label as the name of an HDF5 group: "/" would make a path of it.
std::string group_name(std::string label) {
  std::replace(label.begin(), label.end(), '/', '_');
  return label;
}

void write_curve(Hdf5Group group, const MeasuredCurve& curve) {
  const PlannedCurve& planned = *curve.planned;
  group.attribute("radius", planned.radius);
  group.attribute("stiffness_power", planned.powers.stiffness);
  group.attribute("adhesion_power", planned.powers.adhesion);
  for (const auto& [key, value] : planned.varied) group.attribute(key, value);
  std::vector<std::int64_t> seeds(curve.seeds.begin(), curve.seeds.end());
  group.write("seeds", seeds, 1, {"-", "seed of each run"});
  Hdf5Group scalars = group.create_group("scalars");
  for (const ScalarKind& kind : scalar_kinds())
    if (const auto values = curve.values(kind.name); !values.empty())
      scalars.write(kind.name, values, 1, {kind.unit, kind.description + ", of each run that has it"});
  for (const ObservableKind& kind : observable_kinds()) {
    const std::vector<Curve> seeds_of = curve.curves(kind.name);
    const Band band = band_of(seeds_of);
    if (band.x.empty()) continue;
    Hdf5Group observable = group.create_group(kind.name);
    observable.write("x", band.x, 1, {kind.x_unit, kind.x_label});
    observable.write("mean", band.mean, 1, {kind.y_unit, kind.y_label + ", mean over seeds"});
    observable.write("deviation", band.deviation, 1, {kind.y_unit, "standard deviation over seeds, 0 for one"});
    std::vector<double> each;  // x by seed
    for (const double x : band.x)
      for (const Curve& one : seeds_of) each.push_back(value_at(one, std::clamp(x, one.x.front(), one.x.back())));
    observable.write("each", each, static_cast<int>(seeds_of.size()),
                     {kind.y_unit, kind.y_label + ", rows as x, a column for each seed"});
  }
}

void write_scan_groups(Hdf5Group scans, const PartResults& part) {
  for (std::size_t k = 0; k < part.scans.size(); ++k) {
    const ScanResult& scan = part.scans[k];
    Hdf5Group group = scans.create_group(fmt::format("{:04}", k));
    group.attribute("scanned", power_name(scan));
    for (const auto& [key, value] : scan.varied) group.attribute(key, value);
    group.attribute("reference", scan.reference);
    group.attribute("observable", scan.observable);
    group.attribute("radius", scan.radius);
    group.attribute("other_power", scan.other_power);
    group.attribute("seeds", static_cast<std::int64_t>(scan.seeds));
    group.attribute("best_tried", scan.best_tried);
    group.write("powers", scan.powers, 1, {"-", "tried powers of R"});
    group.write("errors", scan.errors, 1, {"-", "root mean square over seeds, over the reference's range"});
    if (!scan.minimum) continue;
    group.attribute("minimum", scan.minimum->power);
    group.attribute("uncertainty", scan.minimum->uncertainty);
    group.attribute("inside", scan.minimum->inside);
  }
}

void write_statement(Hdf5Group group, const Statement& s) {
  group.attribute("study", s.part);
  group.attribute("figure", s.figure);
  group.attribute("statement", s.text);
  group.attribute("number", s.number);
  group.attribute("seeds", static_cast<std::int64_t>(s.seeds));
  group.attribute("verdict", verdict(s));
}

}  // namespace

fs::path part_folder(const fs::path& folder, const StudyPlan& plan, const PlannedPart& part) {
  return plan.study->parts.empty() ? folder : folder / part.study->name;
}

void write_run_table(const fs::path& folder, const StudyPlan& plan, const std::vector<JobOutcome>& outcomes) {
  std::string text = "run,state,exit code,spheres,seed,message\n";
  for (std::size_t k = 0; k < plan.jobs.size(); ++k) {
    const JobOutcome& outcome = outcomes[k];
    const bool good = outcome.state == JobState::done || outcome.state == JobState::kept;
    const bool failed = outcome.state == JobState::failed;
    text += fmt::format("{},{},{},{},{},{}\n", cell(plan.jobs[k].name),
                        good     ? "done"
                        : failed ? "failed"
                                 : "not run",
                        good || failed ? std::to_string(outcome.exit_code) : "", plan.jobs[k].c.particles.count,
                        plan.jobs[k].c.seed, cell(outcome.message));
  }
  write_whole_file(folder / "runs.csv", text);
}

void write_part_tables(const fs::path& folder, const StudyPlan& plan, const PartResults& part) {
  const fs::path own = part_folder(folder, plan, *part.plan), tables = own / "tables";
  // What an earlier form of the study left there must not stand beside the new.
  std::error_code ignored;
  fs::remove_all(tables, ignored), fs::remove_all(own / "figures", ignored);
  make_folder(tables);
  for (const std::string& observable : part.plan->study->observables) write_curves(tables, part, observable);
  write_scalars(tables / "scalars.csv", part);
  write_collapse(tables / "collapse.csv", part);
  if (!part.plan->study->scans.empty()) write_scans(tables / "scans.csv", part);
  if (part.plan->study->match_porosity) write_match(folder, tables / "porosity_match.csv", plan, *part.plan);
  if (part.plan->study->timed) write_timing(tables / "timing.csv", plan, part);
}

void write_statements(const fs::path& folder, const std::vector<Statement>& statements) {
  write_whole_file(folder / "statements.md", statements_markdown(statements));
  std::string text = "study,figure,statement,number,seeds,verdict\n";
  for (const Statement& s : statements)
    text += fmt::format("{},{},{},{},{},{}\n", cell(s.part), cell(s.figure), cell(s.text), cell(s.number), s.seeds, verdict(s));
  write_whole_file(folder / "statements.csv", text);
}

// The group of a part in study.h5: its name, unless the file has another use for that.
std::string part_group(const std::string& name, const StudyPlan& plan) {
  std::string group = name == "study" ? "part" : name == "statements" ? "part-statements" : name;
  const auto taken = [&] {
    return group != name && std::any_of(plan.study->parts.begin(), plan.study->parts.end(), [&](const Study& part) { return part.name == group; });
  };
  while (taken()) group += "-";
  return group;
}

void write_study_h5(const fs::path& folder, const StudyPlan& plan, const std::vector<PartResults>& results,
                    const std::vector<Statement>& statements) {
  Hdf5File file = Hdf5File::create(folder / "study.h5");
  {
    Hdf5Group root = file.root();
    root.attribute("title", plan.study->title);
    root.attribute("version", PLATEN_VERSION);
    root.write_text("study", plan.study->text, {"-", "the study (TOML) with overrides applied"});
    for (const PartResults& part : results) {
      Hdf5Group group = root.create_group(part_group(part.plan->study->name, plan));
      group.attribute("reference_radius", part.plan->reference_radius);
      Hdf5Group curves = group.create_group("curves");
      for (const MeasuredCurve& curve : part.curves)
        write_curve(curves.create_group(group_name(curve.planned->label)), curve);
      Hdf5Group collapse = group.create_group("collapse");
      for (const CollapseRow& row : part.collapse) {
        const std::string name = group_name(part.curves[row.curve].planned->label);
        Hdf5Group of_curve = collapse.has(name) ? collapse.group(name) : collapse.create_group(name);
        of_curve.write(row.observable, row.error.each, 1,
                       {observable_kind(row.observable).y_unit, "RMS distance of each seed from the mean of \"" +
                                                                    part.curves[row.reference].planned->label + "\""});
      }
      if (!part.scans.empty()) write_scan_groups(group.create_group("scans"), part);
    }
    Hdf5Group judged = root.create_group("statements");
    for (std::size_t k = 0; k < statements.size(); ++k) write_statement(judged.create_group(fmt::format("{:04}", k)), statements[k]);
  }
  file.close();
}

}  // namespace platen
