#include "protocol/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

namespace platen {
namespace {

constexpr double in_place_interval = 0.1, line_interval = 10.0;  // [s]
constexpr std::size_t line_columns = 160;                        // where there is no terminal

// Two decimals, and no minus before nothing.
std::string kilopascal(double stress) {
  const std::string text = fmt::format("{:.2f} kPa", 1e-3 * stress);
  return text == "-0.00 kPa" ? "0.00 kPa" : text;
}

bool is_capable_terminal(std::FILE* stream) {
  const char* term = std::getenv("TERM");
  return isatty(fileno(stream)) != 0 && term != nullptr && std::strcmp(term, "dumb") != 0;
}

std::size_t terminal_columns(std::FILE* stream) {
  winsize size{};
  if (ioctl(fileno(stream), TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  return 80;
}

std::string bar(double fraction) {
  constexpr int width = 10;
  const int full = static_cast<int>(std::clamp(fraction, 0.0, 1.0) * width);
  return "[" + std::string(static_cast<std::size_t>(full), '#') + std::string(static_cast<std::size_t>(width - full), '-') +
         "]";
}

struct Part {
  std::string text;
  int rank;  // the highest goes first when there is no room
};

}  // namespace

std::string duration_text(double seconds) {
  if (!(seconds >= 0.0) || seconds > 1e9) return "-";
  if (seconds < 9.95) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<long>(std::lround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  const long minutes = std::lround(seconds / 60.0);
  if (minutes < 48 * 60) return fmt::format("{} h {:02} min", minutes / 60, minutes % 60);
  const long hours = std::lround(seconds / 3600.0);
  return fmt::format("{} d {} h", hours / 24, hours % 24);
}

std::string progress_line(const Progress& p, std::size_t columns) {
  const Measures& m = p.row.measures;
  std::vector<Part> parts;
  parts.push_back({fmt::format("{}/{} {}", p.stage_number, p.stages, p.stage), 0});
  if (p.fraction) {
    parts.push_back({bar(*p.fraction), 8});
    parts.push_back({fmt::format("{:.0f} %", 100.0 * std::clamp(*p.fraction, 0.0, 1.0)), 1});
  }
  parts.push_back({fmt::format("t {:.3f} s", p.time), 2});
  parts.push_back({kilopascal(m.stress_top), 4});
  if (std::isfinite(p.row.strain)) parts.push_back({fmt::format("strain {:.2f} %", 100.0 * p.row.strain), 5});
  if (std::isfinite(m.porosity)) parts.push_back({fmt::format("porosity {:.3f}", m.porosity), 6});
  parts.push_back({fmt::format("CN {:.2f}", m.coordination_number), 7});
  if (p.particle_steps_per_second > 0.0)
    parts.push_back({fmt::format("{:.1f} M particle-steps/s", 1e-6 * p.particle_steps_per_second), 9});
  if (p.seconds_left) parts.push_back({duration_text(*p.seconds_left) + " left", 3});
  const auto joined = [&] {
    std::string line;
    for (const Part& part : parts) line += (line.empty() ? "" : "  ") + part.text;
    return line;
  };
  std::string line = joined();
  while (line.size() > columns && parts.size() > 1) {
    parts.erase(std::max_element(parts.begin(), parts.end(),
                                 [](const Part& a, const Part& b) { return a.rank < b.rank; }));
    line = joined();
  }
  return line.substr(0, columns);
}

std::string stage_line(const StageResult& stage, int number, int stages) {
  const Measures& m = stage.last.measures;
  std::string line = fmt::format("{}/{} {}: {}; {:.3f} s simulated in {}, {}", number, stages, stage.name,
                                 stage.end_reason, stage.time_end - stage.time_begin, duration_text(stage.wall_seconds),
                                 kilopascal(m.stress_top));
  if (std::isfinite(stage.last.strain)) line += fmt::format(", strain {:.2f} %", 100.0 * stage.last.strain);
  if (std::isfinite(m.porosity)) line += fmt::format(", porosity {:.3f}", m.porosity);
  line += fmt::format(", CN {:.2f}", m.coordination_number);
  if (std::isfinite(stage.residual_share)) line += fmt::format(", energy open by {:.2g} %", 100.0 * std::fabs(stage.residual_share));
  return line + "\n";
}

ProgressPrinter::ProgressPrinter(std::FILE* stream, Style style, std::vector<std::string> stages)
    : stream_(stream), style_(style), stages_(std::move(stages)) {}

void ProgressPrinter::update(const Progress& progress) {
  if (style_ == Style::quiet) return;
  const bool in_place = style_ == Style::in_place;
  if (!started_) {
    started_ = true;
    next_ = progress.wall_seconds + (in_place ? 0.0 : line_interval);
  }
  if (progress.wall_seconds < next_) return;
  next_ = progress.wall_seconds + (in_place ? in_place_interval : line_interval);
  if (in_place) {
    // One column is left free: a full line would wrap on some terminals.
    const std::string line = progress_line(progress, terminal_columns(stream_) - 1);
    std::fputs(("\r" + line + "\x1b[K").c_str(), stream_);
    shown_ = true;
  } else {
    std::fputs((progress_line(progress, line_columns) + "\n").c_str(), stream_);
  }
  std::fflush(stream_);
}

void ProgressPrinter::stage_closed(const StageResult& stage) {
  if (style_ == Style::quiet) return;
  clear();
  const auto found = std::find(stages_.begin(), stages_.end(), stage.name);
  std::fputs(stage_line(stage, static_cast<int>(found - stages_.begin()) + 1, static_cast<int>(stages_.size())).c_str(),
             stream_);
  for (const std::string& warning : stage.warnings)
    std::fputs(fmt::format("warning: {}: {}\n", stage.name, warning).c_str(), stream_);
  std::fflush(stream_);
}

void ProgressPrinter::clear() {
  if (!shown_) return;
  std::fputs("\r\x1b[K", stream_);
  std::fflush(stream_);
  shown_ = false;
}

ProgressPrinter::Style progress_style(std::FILE* stream, bool quiet) {
  if (quiet) return ProgressPrinter::Style::quiet;
  return is_capable_terminal(stream) ? ProgressPrinter::Style::in_place : ProgressPrinter::Style::lines;
}

bool may_colour(std::FILE* stream) {
  const char* refused = std::getenv("NO_COLOR");
  return is_capable_terminal(stream) && (refused == nullptr || *refused == '\0');
}

}  // namespace platen
