// Work against precision: single collisions over the step; a bed's strain, porosity, contacts, strength and energy ledger
// over the step, the speed of the plates, the size of the spheres, and over what must not matter (skin, --reproducible).
//
//   bench_accuracy --case I -o accuracy-I        the same with II and III; --quick for a look
//   bench_accuracy --case II -o accuracy-II --parts step,speed
//   bench_accuracy --case II -o strength-II --parts auto --safeties 0.3 --seeds 64    one question, many beds
//
// In the folder: collisions.csv, bulk.csv, accuracy.json, plots (gnuplot), recommendation.md, and the runs themselves; a
// run that is there already is not repeated.
#include <CLI/CLI.hpp>

#include <cstdio>
#include <cstdlib>
#include <set>

#include "bench/accuracy/bulk.h"
#include "bench/accuracy/collisions.h"
#include "bench/accuracy/trend.h"

using namespace platen;
using namespace platen::bench;

namespace {

namespace fs = std::filesystem;

nlohmann::json collisions(const fs::path& folder, bool quick, std::string& report) {
  const std::vector<double> shares = quick ? std::vector<double>{0.4, 0.2, 0.1, 0.05} : std::vector<double>{0.8, 0.4, 0.2, 0.1, 0.05, 0.025, 0.0125};
  std::ofstream csv(folder / "collisions.csv");
  csv << "kind,dt over dt_crit,restitution error,spin error,wall seconds\n";
  nlohmann::json rows = nlohmann::json::array();
  report += "## Single collisions\n\nMean error over 48 oblique collisions against a step of " + std::string(quick ? "0.002" : "0.0005") +
            " dt_crit.\n\n| collision | error of restitution at 0.2 dt_crit | of spin | slope of restitution | slope of spin |\n|---|---|---|---|---|\n";
  for (const CollisionKind& kind : collision_kinds()) {
    const auto points = collision_points(kind, shares, quick ? 0.002 : 0.0005);
    double at[2] = {0, 0};
    for (const CollisionPoint& p : points) {
      csv << fmt::format("\"{}\",{},{:.6e},{:.6e},{:.4e}\n", p.kind, p.share, p.restitution_error, p.spin_error, p.seconds);
      rows.push_back({{"kind", p.kind}, {"share", p.share}, {"restitution_error", p.restitution_error}, {"spin_error", p.spin_error}, {"seconds", p.seconds}});
      if (p.share == 0.2) at[0] = p.restitution_error, at[1] = p.spin_error;
    }
    csv << "\n\n";  // a block of its own for gnuplot
    report += fmt::format("| {} | {:.1e} | {:.1e} | {:.2f} | {:.2f} |\n", kind.name, at[0], at[1], slope_of(points, &CollisionPoint::restitution_error),
                          slope_of(points, &CollisionPoint::spin_error));
  }
  return rows;
}

// Every setting of the parts asked for. Equal ones have equal names and are run once.
std::vector<Setting> settings_of(const std::vector<std::string>& parts, const BulkSize& size, int seeds) {
  std::vector<Setting> settings;
  const auto add = [&](const char* part, double value, double share, double speed) -> Setting& {
    Setting v{part, fmt::format("dt{:g}-v{:g}", share, 1e3 * speed), value, share, speed};
    v.seeds = seeds;
    settings.push_back(v);
    return settings.back();
  };
  const auto add_automatic = [&](const char* part, double value, double safety, double speed) -> Setting& {
    Setting& v = add(part, value, safety, speed);
    v.automatic = true, v.name = fmt::format("auto{:g}-v{:g}", safety, 1e3 * speed);
    return v;
  };
  const auto asked = [&](const char* part) { return std::find(parts.begin(), parts.end(), part) != parts.end(); };
  if (asked("step"))
    for (const double share : size.shares) add("step", share, share, size.speed);
  if (asked("auto")) {
    add("auto", 0.0, size.shares.front(), size.speed);  // the finest fixed step is the reference
    for (const double safety : size.safeties) add_automatic("auto", safety, safety, size.speed);
  }
  if (asked("speed"))
    for (const double speed : size.speeds) add_automatic("speed", speed, size.safety, speed);
  if (asked("same")) {
    add_automatic("same", 0, size.safety, size.speed);
    for (const double skin : {0.1, 0.4, 0.8}) {  // of R
      Setting& v = add_automatic("same", skin, size.safety, size.speed);
      v.skin = skin * scale_radius, v.seeds = 2, v.name += fmt::format("-skin{:g}", skin);
    }
    Setting& v = add_automatic("same", -1, size.safety, size.speed);
    v.reproducible = true, v.name += "-reproducible";
  }
  if (asked("scale"))
    for (const double radius : size.radii) {
      Setting& v = add_automatic("scale", radius, size.safety, size.speed);
      v.radius = radius, v.seeds = radius == scale_radius ? seeds : size.scale_seeds;
      if (radius != scale_radius) v.name += fmt::format("-R{:g}mm", 1e3 * radius);
    }
  return settings;
}

// gnuplot stops at a plot without points: only what was measured is drawn.
void plot(const fs::path& folder, bool crush, const std::vector<std::string>& parts) {
  const auto asked = [&](const char* part) { return std::find(parts.begin(), parts.end(), part) != parts.end(); };
  std::ofstream gp(folder / "plots.gp");
  gp << "set datafile separator ','\nset datafile missing NaN\nset terminal svg noenhanced size 720,480 font 'sans,13'\nset key outside below\nset grid\n";
  if (asked("collisions"))
    gp << "set logscale xy\nset format y '%.0e'\nset output 'collisions.svg'\nset xlabel 'wall time of 48 collisions (s)'\nset ylabel 'mean error of restitution'\n"
          "plot for [k=0:3] 'collisions.csv' index k using 5:3 skip (k == 0 ? 1 : 0) with linespoints title word('elastic damped plastic cohesive', k+1)\n"
          "set output 'collisions-step.svg'\nset xlabel 'dt / dt_crit'\n"
          "plot for [k=0:3] 'collisions.csv' index k using 2:3 skip (k == 0 ? 1 : 0) with linespoints title word('elastic damped plastic cohesive', k+1), x*x title 'second order' dashtype 2 lc 'grey', 0.1*x title 'first order' dashtype 3 lc 'grey'\n"
          "unset logscale\n";
  struct Axis {
    const char *part, *label;
  };
  for (const Quantity& q : quantities) {
    if (!crush && std::string(q.key) == "strength") continue;
    const auto rows = [&](const char* part, const char* x) {
      return fmt::format("'bulk.csv' using (strcol(1) eq '{}' && strcol(4) eq '{}' ? {} : NaN)", part, q.key, x);
    };
    gp << "set format y '%g'\n";
    for (const Axis& axis : {Axis{"step", "dt / dt_crit"}, Axis{"auto", "safety of the automatic step (0: the smallest fixed one)"}, Axis{"speed", "plate speed (m/s)"}, Axis{"scale", "R (m)"}}) {
      if (!asked(axis.part)) continue;
      const std::string points = rows(axis.part, "column(2)");
      gp << fmt::format("set output 'bulk-{}-{}.svg'\nset title '{}'\nset xlabel '{}'\nset ylabel 'difference'\n"
                        "plot {}:5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', {}:7 skip 1 with lines lc 'grey' title 'scatter between seeds', "
                        "{}:(-column(7)) skip 1 with lines lc 'grey' notitle\n",
                        axis.part, q.key, q.name, axis.label, points, points, points);
    }
    // Work against precision: every setting of a part is a point of its line.
    std::string lines, scatter;
    for (const Axis& axis : {Axis{"step", "fixed step"}, Axis{"auto", "automatic step"}, Axis{"speed", "plate speed"}}) {
      if (!asked(axis.part)) continue;
      const std::string points = rows(axis.part, "column(5) != 0 ? column(8) : NaN");
      if (scatter.empty()) scatter = fmt::format("{}:7 skip 1 with lines lc 'grey' title 'scatter between seeds', {}:(column(7)/2) skip 1 with lines dashtype 2 lc 'grey' title 'half of it'", points, points);
      lines += fmt::format("{}:(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title '{}, twice the standard error', ", points, axis.label);
    }
    if (!lines.empty())
      gp << fmt::format("set output 'work-{}.svg'\nset title '{}'\nset xlabel 'cost of a run (1e9 particle-steps)'\nset ylabel '|difference|'\nset yrange [0:*]\nplot {}{}\nset yrange [*:*]\n", q.key, q.name, lines, scatter);
    // Coarser spheres save far more than any step and cost far more error: a plot of its own.
    if (asked("scale")) {
      const std::string points = rows("scale", "column(5) != 0 ? column(8) : NaN");
      gp << fmt::format("set logscale x\nset output 'work-scale-{}.svg'\nset title '{}'\nset xlabel 'cost of a run (1e9 particle-steps)'\nset ylabel '|difference|'\nset yrange [0:*]\n"
                        "plot {}:(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'size of the spheres, twice the standard error', {}:(abs(column(5))):(sprintf('%g mm', 1e3*column(2))) skip 1 with labels offset 3,0.6 notitle, "
                        "{}:7 skip 1 with lines lc 'grey' title 'scatter between seeds'\nset yrange [*:*]\nunset logscale\n",
                        q.key, q.name, points, points, points);
    }
  }
  if (asked("step"))
    gp << "set logscale y\nset format y '%.0e'\nset output 'energy.svg'\nset title 'energy ledger'\nset xlabel 'dt / dt_crit'\nset ylabel 'ledger residual / dissipated energy'\n"
          "plot 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'energy' ? column(2) : NaN):3 skip 1 with linespoints notitle\n";
  gp.close();
  const std::string command = "cd '" + folder.string() + "' && gnuplot plots.gp";
  if (std::system(command.c_str()) != 0) std::fprintf(stderr, "bench_accuracy: gnuplot did not run; plots.gp is there\n");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("run time against error");
  std::string name = "I";
  fs::path folder;
  bool quick = false;
  int processes = 1, seeds = 0;
  std::vector<std::string> parts = {"collisions", "step", "auto", "speed", "same", "scale"};
  std::vector<double> safeties;
  app.add_option("--case", name, "I, II or III of the paper, at R = 3.75 mm")->check(CLI::IsMember({"I", "II", "III"}));
  app.add_option("-o", folder, "folder")->required();
  app.add_flag("--quick", quick, "140 spheres, fast plates, three seeds: a look, not a result");
  app.add_option("--jobs", processes, "runs side by side")->check(CLI::Range(1, 1024));
  app.add_option("--seeds", seeds, "beds (default 8; 3 with --quick)")->check(CLI::Range(2, 100));
  app.add_option("--parts", parts, "of the measurement: collisions, step, auto, speed, same, scale (all)")->delimiter(',')->check(CLI::IsMember({"collisions", "step", "auto", "speed", "same", "scale"}));
  app.add_option("--safeties", safeties, "of the part auto (default 0.2,0.3,0.4,0.5; 0.2,0.4 with --quick)")->delimiter(',')->check(CLI::Range(0.01, 0.9));
  CLI11_PARSE(app, argc, argv);
  try {
    fs::create_directories(folder);
    const BulkCase b = bulk_case(name);
    BulkSize size = bulk_size(quick);
    if (!safeties.empty()) size.safeties = safeties;
    const bool crush = b.crush;
    const int beds = seeds > 0 ? seeds : size.seeds;
    std::string report = fmt::format("# Accuracy, case {}\n\n{}{} spheres of R = 3.75 mm in a periodic box of {:g} x {:g} mm, {} seeds.\n\n", name,
                                     quick ? "A quick look, not a result. " : "", size.count, 1e3 * size.side, 1e3 * size.side, beds);
    nlohmann::json collision_rows;
    if (std::find(parts.begin(), parts.end(), "collisions") != parts.end()) collision_rows = collisions(folder, quick, report);

    // dt_crit as the program takes it before contacts exist.
    const double dt_crit = first_step(parse_case(bed_job(b, size, 1, scale_radius, 1e-6).text, "probe", folder)).limits.dt_crit;
    const std::vector<Setting> settings = settings_of(parts, size, beds);
    std::map<std::pair<double, int>, Job> bed_jobs;
    std::map<std::string, Job> run_list;
    std::vector<Job> jobs;
    for (const Setting& v : settings)
      for (int seed = 1; seed <= v.seeds; ++seed) {
        bed_jobs.emplace(std::pair(v.radius, seed), bed_job(b, size, seed, v.radius, dt_crit));
        const Job job = variant_job(b, size, seed, v, dt_crit);
        if (run_list.emplace(job.name, job).second) jobs.push_back(job);
      }
    std::vector<Job> first;
    for (const auto& [key, job] : bed_jobs) first.push_back(job);
    std::fprintf(stderr, "%zu beds\n", first.size());
    run_jobs(first, folder, processes);
    for (const Job& bed : first) write_bed(folder / bed.name, folder / (bed.name + ".csv"));
    std::fprintf(stderr, "%zu runs\n", jobs.size());
    run_jobs(jobs, folder, processes);

    Figures figures;
    for (const Setting& v : settings) {
      auto& runs = figures[v.name];
      for (int seed = static_cast<int>(runs.size()) + 1; seed <= v.seeds; ++seed) runs.push_back(bulk_figures(folder / fmt::format("{}-{}", v.name, seed)));
    }
    nlohmann::json rows = nlohmann::json::array();
    std::vector<Verdict> all;
    const auto part = [&](const std::string& what, const std::string& title, const std::string& head, bool pairs, const auto& value) {
      std::vector<const Setting*> chosen;
      for (const Setting& v : settings)
        if (v.part == what) chosen.push_back(&v);
      if (chosen.empty()) return;
      const std::vector<Verdict> verdicts = judge(chosen, *chosen.front(), figures, crush, pairs);
      report += "## " + title + "\n\n" + verdict_table(head, verdicts, *chosen.front(), figures, value) + "\n";
      for (const Verdict& v : verdicts)
        rows.push_back({{"what", what}, {"setting", v.setting->name}, {"value", v.setting->value}, {"quantity", v.quantity}, {"mean", v.mean}, {"difference", v.difference},
                        {"standard_error", v.error}, {"seed_scatter", v.scatter}, {"work", work_of(figures, *v.setting)}, {"seconds", seconds_of(figures, *v.setting).mean}, {"complete", v.complete}});
      for (const Setting* v : chosen)
        rows.push_back({{"what", what}, {"setting", v->name}, {"value", v->value}, {"quantity", "energy"}, {"mean", moments(column(figures, v->name, "energy")).mean}, {"work", work_of(figures, *v)}, {"seconds", seconds_of(figures, *v).mean}});
      // A reference is no candidate: its own error is not in its difference of 0. A step fixed for all stages is nobody's
      // choice; the automatic one of that cost is.
      for (const Verdict& v : verdicts)
        if ((what == "auto" || what == "speed") && v.setting != chosen.front()) all.push_back(v);
    };
    report += fmt::format("\ndt_crit = {:.4g} s (before contacts exist), {:g} kPa. Differences: mean ± standard error. The bound is |mean| + 2 standard errors of the quantity that is farthest off, "
                          "over the scatter between seeds of the reference.\n\n", dt_crit, 1e-3 * size.stress);
    part("step", fmt::format("The bed over the step, plates at {:g} mm/s", 1e3 * size.speed), "dt / dt_crit", true, [](const Setting& v) { return fmt::format("{:g}", v.value); });
    part("auto", "The bed over the safety of the automatic step", "safety", true, [](const Setting& v) { return v.automatic ? fmt::format("{:g}", v.value) : fmt::format("fixed, {:g} dt_crit", v.share); });
    if (std::find(parts.begin(), parts.end(), "auto") != parts.end()) {
      std::vector<const Setting*> steps;
      std::set<std::string> known;
      for (const Setting& v : settings)
        if ((v.part == "step" || v.part == "auto") && known.insert(v.name).second) steps.push_back(&v);
      report += "### Trend over the step\n\nLeast squares through all these runs, a level for each seed and one slope: the change between this step and none, ± standard error. Bounds as above, in the order of the columns, but over the scatter between seeds of all these settings.\n\n" +
                trend_table(steps, figures, crush, over_steps(figures, dt_crit)) + "\n";
    }
    part("speed", fmt::format("The bed over the speed of the plates, safety {:g}", size.safety), "plate speed (mm/s)", true, [](const Setting& v) { return fmt::format("{:g}", 1e3 * v.value); });
    if (std::find(parts.begin(), parts.end(), "speed") != parts.end()) {
      std::vector<const Setting*> speeds;
      for (const Setting& v : settings)
        if (v.part == "speed") speeds.push_back(&v);
      report += "### Trend over the speed\n\nThe same over the speed of the plates: the change between this speed and none. A line is assumed: bounds of slow plates are fractions of those of the fastest.\n\n" + trend_table(speeds, figures, crush, over_speeds(figures)) + "\n";
    }
    part("same", "What must not matter", "setting", true, [](const Setting& v) { return v.reproducible ? std::string("--reproducible") : v.skin > 0 ? fmt::format("skin {:g} R", v.value) : std::string("default"); });
    part("scale", "The bed over the size of the spheres, stiffness ~ R, f0 ~ R^2", "R (mm)", false, [](const Setting& v) { return fmt::format("{:g}", 1e3 * v.value); });
    if (!all.empty()) report += "## If you accept ... the fastest setting measured is\n\n" + recommendation_table(all, figures, crush);

    std::ofstream csv(folder / "bulk.csv");
    csv << "what,value,mean,quantity,difference,standard error,seed scatter,work [1e9 particle-steps],seconds\n";
    const auto cell = [](const nlohmann::json& row, const char* key) { return row.contains(key) && row[key].is_number() ? fmt::format("{:.8g}", row[key].get<double>()) : std::string("nan"); };
    for (const auto& row : rows)
      csv << row["what"].get<std::string>() << "," << cell(row, "value") << "," << cell(row, "mean") << "," << row["quantity"].get<std::string>() << "," << cell(row, "difference") << ","
          << cell(row, "standard_error") << "," << cell(row, "seed_scatter") << "," << cell(row, "work") << "," << cell(row, "seconds") << "\n";
    csv.close();
    std::ofstream(folder / "accuracy.json") << nlohmann::json{{"bench", "accuracy"}, {"case", name}, {"quick", quick}, {"processor", processor_name()}, {"dt_crit", dt_crit},
                                                              {"seeds", beds}, {"collisions", collision_rows}, {"bulk", rows}, {"runs", figures}}.dump(1) << "\n";
    std::ofstream(folder / "recommendation.md") << report;
    plot(folder, crush, parts);
    std::fputs(report.c_str(), stdout);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_accuracy: %s\n", error.what());
    return 2;
  }
  return 0;
}
