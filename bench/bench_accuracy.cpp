// Work against precision: single collisions over the step, a bed's strain, porosity, contacts and strength over the step
// and the speed of the plates, the energy ledger over the step.
//
//   bench_accuracy --case I -o accuracy-I        the same with II and III; --quick for a look
//
// In the folder: collisions.csv, bulk.csv, accuracy.json, plots (gnuplot), recommendation.md, and the runs themselves; a
// run that is there already is not repeated.
#include <CLI/CLI.hpp>

#include <cstdio>
#include <cstdlib>

#include "bench/accuracy/bulk.h"
#include "bench/accuracy/collisions.h"

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

struct Setting {
  std::string name, what;  // what: "step" or "speed"
  double value = 0.0, dt = 0.0, speed = 0.0;
};

struct Quantity {
  const char *key, *name;
};
constexpr Quantity quantities[] = {{"strain", "strain at the end of compression"}, {"porosity", "porosity there"},
                                   {"coordination_number", "coordination number there"}, {"strength", "unconfined strength (Pa)"}};

// Which of the values of `what` keep every quantity within the scatter between seeds, and how far off each is.
std::string verdict(const std::string& what, const std::vector<Setting>& variants, std::map<std::string, std::vector<std::map<std::string, double>>>& figures,
                    nlohmann::json& rows, bool crush) {
  const auto column = [&](const std::string& name, const char* key) {
    std::vector<double> x;
    for (auto& run : figures[name]) x.push_back(run[key]);
    return x;
  };
  std::string table = what == "step" ? "| dt / dt_crit |" : "| plate speed (mm/s) |";
  for (const Quantity& q : quantities)
    if (crush || std::string(q.key) != "strength") table += fmt::format(" {} |", q.name);
  table += " ledger residual / dissipated | wall time (s) | within the scatter |\n|" + std::string(crush ? "---|---|---|---|---|---|---|---|" : "---|---|---|---|---|---|---|") + "\n";
  const Setting* reference = nullptr;
  double best = 0.0;
  bool so_far = true;
  for (const Setting& v : variants) {
    if (v.what != what) continue;
    if (!reference) reference = &v;
    table += fmt::format("| {:g} |", what == "step" ? v.value : 1e3 * v.value);
    bool good = true;
    for (const Quantity& q : quantities) {
      if (!crush && std::string(q.key) == "strength") continue;
      const std::vector<double> x = column(v.name, q.key), x0 = column(reference->name, q.key);
      const Difference d = paired(x, x0);
      const double spread = scatter(x0);
      double mean = 0.0;
      int n = 0;
      for (const double value : x0)
        if (std::isfinite(value)) mean += value, ++n;
      mean /= n;
      if (&v == reference) table += fmt::format(" {:.5g}, seeds ±{:.2g} |", mean, spread);
      else table += fmt::format(" {:+.2g} ± {:.2g} |", d.mean, d.error);
      // No more than the scatter, its own uncertainty included; a run that failed is not good.
      if (&v != reference && !(std::fabs(d.mean) + d.error <= spread && d.pairs == static_cast<int>(x.size()))) good = false;
      rows.push_back({{"what", what}, {"value", v.value}, {"quantity", q.key}, {"mean", mean}, {"difference", d.mean}, {"standard_error", d.error}, {"pairs", d.pairs}, {"seed_scatter", spread}});
    }
    double energy = 0.0, seconds = 0.0;
    for (auto& run : figures[v.name]) energy += run["energy"] / static_cast<double>(figures[v.name].size()), seconds += run["seconds"] / static_cast<double>(figures[v.name].size());
    rows.push_back({{"what", what}, {"value", v.value}, {"quantity", "energy"}, {"mean", energy}, {"seconds", seconds}});
    so_far = so_far && good;
    if (so_far) best = v.value;
    table += fmt::format(" {:.1e} | {:.1f} | {} |\n", energy, seconds, &v == reference ? "reference" : good ? "yes" : "no");
  }
  table += what == "step" ? fmt::format("\nLargest step within the scatter between seeds: **{:g} dt_crit**.\n\n", best)
                          : fmt::format("\nFastest plates within the scatter between seeds: **{:g} mm/s**.\n\n", 1e3 * best);
  return table;
}

void plot(const fs::path& folder, bool crush) {
  std::ofstream gp(folder / "plots.gp");
  gp << "set datafile separator ','\nset datafile missing NaN\nset terminal svg noenhanced size 720,480 font 'sans,13'\nset logscale xy\nset format y '%.0e'\nset key outside below\nset grid\n"
        "set output 'collisions.svg'\nset xlabel 'wall time of 48 collisions (s)'\nset ylabel 'mean error of restitution'\n"
        "plot for [k=0:3] 'collisions.csv' index k using 5:3 skip (k == 0 ? 1 : 0) with linespoints title word('elastic damped plastic cohesive', k+1)\n"
        "set output 'collisions-step.svg'\nset xlabel 'dt / dt_crit'\n"
        "plot for [k=0:3] 'collisions.csv' index k using 2:3 skip (k == 0 ? 1 : 0) with linespoints title word('elastic damped plastic cohesive', k+1), x*x title 'second order' dashtype 2 lc 'grey', 0.1*x title 'first order' dashtype 3 lc 'grey'\n"
        "unset logscale y\nset format y '%g'\n";
  for (const std::string what : {"step", "speed"})
    for (const Quantity& q : quantities) {
      if (!crush && std::string(q.key) == "strength") continue;
      const std::string rows = fmt::format("'bulk.csv' using (strcol(1) eq '{}' && strcol(4) eq '{}' ? column(2) : NaN)", what, q.key);
      gp << fmt::format("set output 'bulk-{}-{}.svg'\nset xlabel '{}'\nset ylabel '{}'\n"
                        "plot {}:5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', {}:7 skip 1 with lines lc 'grey' title 'scatter between seeds', "
                        "{}:(-column(7)) skip 1 with lines lc 'grey' notitle\n",
                        what, q.key, what == "step" ? "dt / dt_crit" : "plate speed (m/s)", q.name, rows, rows, rows);
    }
  gp << "set logscale y\nset format y '%.0e'\nset output 'energy.svg'\nset xlabel 'dt / dt_crit'\nset ylabel 'ledger residual / dissipated energy'\n"
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
  app.add_option("--case", name, "I, II or III of the paper, at R = 3.75 mm")->check(CLI::IsMember({"I", "II", "III"}));
  app.add_option("-o", folder, "folder")->required();
  app.add_flag("--quick", quick, "140 spheres, fast plates, three seeds: a look, not a result");
  app.add_option("--jobs", processes, "runs side by side")->check(CLI::Range(1, 1024));
  app.add_option("--seeds", seeds, "beds (default 6; 3 with --quick)")->check(CLI::Range(2, 100));
  CLI11_PARSE(app, argc, argv);
  try {
    fs::create_directories(folder);
    const BulkCase b = bulk_case(name);
    BulkSize size = bulk_size(quick);
    const bool crush = b.crush;
    std::string report = fmt::format("# Accuracy, case {}\n\n{}{} spheres of R = 3.75 mm in a periodic box of {:g} x {:g} mm, {} seeds.\n\n", name,
                                     quick ? "A quick look, not a result. " : "", size.count, 1e3 * size.side, 1e3 * size.side, seeds > 0 ? seeds : size.seeds);
    const nlohmann::json collision_rows = collisions(folder, quick, report);

    // dt_crit as the program takes it before contacts exist.
    const Case probe = parse_case(bed_job(b, size, 1, 1e-6).text, "probe", folder);
    const FirstStep first = first_step(probe);
    const double dt_crit = first.limits.dt_crit;
    const int beds = seeds > 0 ? seeds : size.seeds;
    std::vector<Job> jobs;
    for (int seed = 1; seed <= beds; ++seed) jobs.push_back(bed_job(b, size, seed, dt_crit));
    std::fprintf(stderr, "%d beds\n", beds);
    run_jobs(jobs, folder, processes);
    for (int seed = 1; seed <= beds; ++seed) write_bed(folder / bed_name(seed), folder / (bed_name(seed) + ".csv"));

    std::vector<Setting> variants;
    for (const double share : size.shares) variants.push_back({fmt::format("step-{:g}", share), "step", share, share * dt_crit, size.speed});
    for (const double speed : size.speeds) variants.push_back({fmt::format("speed-{:g}", speed), "speed", speed, size.share_of_speeds * dt_crit, speed});
    jobs.clear();
    for (const Setting& v : variants)
      for (int seed = 1; seed <= beds; ++seed) jobs.push_back(variant_job(b, size, seed, v.name, v.dt, v.speed));
    std::fprintf(stderr, "%zu runs\n", jobs.size());
    run_jobs(jobs, folder, processes);

    std::map<std::string, std::vector<std::map<std::string, double>>> figures;
    for (const Setting& v : variants)
      for (int seed = 1; seed <= beds; ++seed) figures[v.name].push_back(bulk_figures(folder / fmt::format("{}-{}", v.name, seed)));
    nlohmann::json rows = nlohmann::json::array();
    report += fmt::format("\n## The bed over the step\n\ndt_crit = {:.4g} s (before contacts exist), plates at {:g} mm/s, {:g} kPa. Differences to the smallest step of the same seed: mean ± standard error.\n\n",
                          dt_crit, 1e3 * size.speed, 1e-3 * size.stress);
    report += verdict("step", variants, figures, rows, crush);
    report += fmt::format("## The bed over the speed of the plates\n\nAt {:g} dt_crit. Differences to the slowest plates of the same seed.\n\n", size.share_of_speeds);
    report += verdict("speed", variants, figures, rows, crush);

    std::ofstream csv(folder / "bulk.csv");
    csv << "what,value,mean,quantity,difference,standard error,seed scatter,seconds\n";
    const auto cell = [](const nlohmann::json& row, const char* key) { return row.contains(key) && row[key].is_number() ? fmt::format("{:.8g}", row[key].get<double>()) : std::string("nan"); };
    for (const auto& row : rows)
      csv << row["what"].get<std::string>() << "," << cell(row, "value") << "," << cell(row, "mean") << "," << row["quantity"].get<std::string>() << "," << cell(row, "difference") << ","
          << cell(row, "standard_error") << "," << cell(row, "seed_scatter") << "," << cell(row, "seconds") << "\n";
    csv.close();
    std::ofstream(folder / "accuracy.json") << nlohmann::json{{"bench", "accuracy"}, {"case", name}, {"quick", quick}, {"processor", processor_name()}, {"dt_crit", dt_crit},
                                                              {"seeds", beds}, {"collisions", collision_rows}, {"bulk", rows}, {"runs", figures}}.dump(1) << "\n";
    std::ofstream(folder / "recommendation.md") << report;
    plot(folder, crush);
    std::fputs(report.c_str(), stdout);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_accuracy: %s\n", error.what());
    return 2;
  }
  return 0;
}
