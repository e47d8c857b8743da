#include "protocol/study/figures.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "protocol/output/files.h"
#include "protocol/study/tables.h"

extern char** environ;

namespace platen {
namespace {

namespace fs = std::filesystem;

// How a quantity is drawn.
struct Axis {
  std::string label;
  double scale = 1.0;
};

Axis axis(const std::string& label, const std::string& unit) {
  if (unit == "Pa") return {label + " [kPa]", 1e-3};
  if (label.find("strain") != std::string::npos) return {label + " [%]", 100.0};
  return {label, 1.0};
}

// Stress over strain and height over porosity, as people draw them; measured the other way round.
bool swapped(const std::string& observable) {
  return observable.starts_with("stress_strain") || observable == "porosity_height";
}

// A text inside gnuplot's double quotes; labels are plain text, not markup.
std::string gnuplot_text(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out + '"';
}

// Eight colours that also the colour-blind can tell apart [Wong 2011, and a purple], then the same dashed.
std::string linetypes() {
  constexpr const char* colours[] = {"000000", "0072b2", "d55e00", "009e73", "cc79a7", "e69f00", "56b4e9", "7f3c8d"};
  const int count = static_cast<int>(std::size(colours));
  std::string text;
  for (int k = 0; k < 2 * count; ++k) text += fmt::format("set linetype {} lc rgb \"#{}\"{}\n", k + 1, colours[k % count], k < count ? "" : " dt 2");
  return text + fmt::format("set linetype cycle {}\n", 2 * count);
}

std::string script_head(const std::string& name, const std::string& title, const std::string& x, const std::string& y) {
  return fmt::format(
      "# gnuplot {0}.gp draws {0}.svg and {0}.png from {0}.dat\n"
      "set terminal svg size 800,560 noenhanced font \"sans,14\" background \"white\"\nset output \"{0}.svg\"\n"
      "set title {1}\nset xlabel {2}\nset ylabel {3}\nset key outside right top\nset grid\n{4}",
      name, gnuplot_text(title), gnuplot_text(x), gnuplot_text(y), linetypes());
}

std::string script_tail(const std::string& name) {
  return fmt::format(
      "\nset terminal pngcairo size 1200,840 noenhanced font \"sans,14\"\nset output \"{}.png\"\nreplot\n", name);
}

// Runs gnuplot in the folder; an empty text, or what went wrong.
std::string run_gnuplot(const fs::path& folder, const std::string& name) {
  // posix_spawn cannot change the folder portably; gnuplot can.
  std::vector<std::string> words{"gnuplot", "-e", "cd " + gnuplot_text(folder.string()),
                                 (folder / (name + ".gp")).string()};
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const fs::path log = folder / (name + ".log");
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  pid_t child = 0;
  const int error = posix_spawnp(&child, "gnuplot", &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0)
    return fmt::format("{}: gnuplot cannot be started ({}); data and script are there", name, std::strerror(error));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {}
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    std::string text = read_whole_file(log);
    std::replace(text.begin(), text.end(), '\n', ' ');
    return WIFEXITED(status) && WEXITSTATUS(status) == 127
               ? name + ": gnuplot is not installed; data and script are there"
               : fmt::format("{}: gnuplot failed: {}", name, text);
  }
  fs::remove(log);
  return {};
}

std::string write_and_draw(const fs::path& folder, const std::string& name, const std::string& data,
                           const std::string& script) {
  write_whole_file(folder / (name + ".dat"), data);
  write_whole_file(folder / (name + ".gp"), script);
  return run_gnuplot(folder, name);
}

std::string draw_curves(const fs::path& folder, const PartResults& part, const FigureSpec& figure) {
  const ObservableKind& kind = observable_kind(figure.observables.front());
  const bool turn = swapped(kind.name);
  const Axis x = axis(kind.x_label, kind.x_unit), y = axis(kind.y_label, kind.y_unit);
  std::string data, plots;
  int index = 0, colour = 0;
  const auto add = [&](const Curve& curve, const std::string& about, const std::string& style) {
    data += fmt::format("# {}: {}, {}\n", about, turn ? y.label : x.label, turn ? x.label : y.label);
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      const double px = x.scale * curve.x[i], py = y.scale * curve.y[i];
      data += fmt::format("{:.9g} {:.9g}\n", turn ? py : px, turn ? px : py);
    }
    data += "\n\n";
    plots += fmt::format("{}  \"{}.dat\" index {} {}", plots.empty() ? "" : ", \\\n", figure.name, index++, style);
  };
  for (const MeasuredCurve& curve : part.curves) {
    const PlannedCurve& planned = *curve.planned;
    if (!figure.curves.empty() &&
        std::find(figure.curves.begin(), figure.curves.end(), planned.block) == figure.curves.end())
      continue;
    bool any = false;
    for (const std::string& observable : figure.observables) {
      const std::vector<Curve> seeds = curve.curves(observable);
      if (seeds.empty()) continue;
      if (!any) ++colour;
      const Band band = band_of(seeds);
      if (seeds.size() > 1)
        for (std::size_t k = 0; k < seeds.size(); ++k) {
          const Band one = band_of({seeds[k]});
          add({one.x, one.mean}, fmt::format("{}, {}, one seed", planned.label, observable),
              fmt::format("with lines lt {} lw 0.5 notitle", colour));
        }
      add({band.x, band.mean}, fmt::format("{}, {}, mean", planned.label, observable),
          fmt::format("with lines lt {} lw 2 {}", colour, any ? "notitle" : "title " + gnuplot_text(planned.label)));
      any = true;
    }
  }
  if (plots.empty()) return figure.name + ": nothing to draw, no run is done";
  return write_and_draw(folder, figure.name, data,
                        script_head(figure.name, figure.title, turn ? y.label : x.label, turn ? x.label : y.label) +
                            "plot \\\n" + plots + script_tail(figure.name));
}

std::string draw_scans(const fs::path& folder, const PartResults& part, ScanSpec::Power power) {
  const std::string word = power == ScanSpec::Power::stiffness ? "stiffness" : "adhesion", name = "scan-" + word;
  std::string data, plots;
  int index = 0;
  for (const ScanResult& scan : part.scans) {
    if (scan.power != power) continue;
    data +=
        fmt::format("# R = {:g} mm, {}: power, error over the reference's range\n", 1e3 * scan.radius, scan.observable);
    for (std::size_t k = 0; k < scan.powers.size(); ++k)
      data += fmt::format("{:.9g} {:.9g}\n", scan.powers[k], scan.errors[k]);
    data += "\n\n";
    std::string title = fmt::format("{:g} mm, {}", 1e3 * scan.radius, scan.observable);
    if (scan.minimum && scan.minimum->inside) title += fmt::format(": {:.2f}", scan.minimum->power);
    plots += fmt::format("{}  \"{}.dat\" index {} with linespoints lw {} title {}", plots.empty() ? "" : ", \\\n", name,
                         index++, scan.observable == "all" ? 3 : 1, gnuplot_text(title));
  }
  if (plots.empty()) return {};
  return write_and_draw(folder, name, data,
                        script_head(name, "collapse error over the " + word + " power", word + " power",
                                    "collapse error / range of the reference") +
                            "set yrange [0:*]\nplot \\\n" + plots + script_tail(name));
}

std::string draw_timing(const fs::path& folder, const PartResults& part) {
  std::map<double, std::string> by_step;
  for (const MeasuredCurve& curve : part.curves)
    for (const double t : curve.wall_seconds)
      by_step[curve.planned->powers.time_step] += fmt::format("{:.9g} {:.9g}\n", 1e3 * curve.planned->radius, t);
  std::string data, plots;
  int index = 0;
  for (const auto& [power, points] : by_step) {
    data += fmt::format("# time step ~ R^{:g}: radius [mm], wall time [s]\n", power) + points + "\n\n";
    plots += fmt::format("{}  \"run-time.dat\" index {} with points pt 7 title \"time step ~ R^{:g}\"",
                         plots.empty() ? "" : ", \\\n", index++, power);
  }
  if (plots.empty()) return {};
  return write_and_draw(folder, "run-time", data,
                        script_head("run-time", "run time", "sphere radius [mm]", "wall time [s]") +
                            "set yrange [0:*]\nplot \\\n" + plots + script_tail("run-time"));
}

}  // namespace

std::vector<std::string> draw_figures(const fs::path& folder, const StudyPlan& plan, const PartResults& part) {
  const fs::path figures = fs::absolute(part_folder(folder, plan, *part.plan)) / "figures";
  std::error_code error;
  fs::create_directories(figures, error);
  if (error) throw OutputError(figures.string() + ": cannot write: " + error.message());
  std::vector<std::string> wrong;
  const auto note = [&](std::string text) {
    if (!text.empty()) wrong.push_back(part.plan->study->name + ": " + std::move(text));
  };
  for (const FigureSpec& figure : part.plan->study->figures) note(draw_curves(figures, part, figure));
  note(draw_scans(figures, part, ScanSpec::Power::stiffness));
  note(draw_scans(figures, part, ScanSpec::Power::adhesion));
  if (part.plan->study->timed) note(draw_timing(figures, part));
  return wrong;
}

}  // namespace platen
