#include "protocol/output/stage_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "protocol/output.h"

namespace platen {

namespace {

constexpr std::size_t width = 100;
constexpr std::size_t gap = 2;

// Three significant digits without an exponent: 40.0, 3.42, 0.020.
std::string three_digits(double value) {
  const double size = std::abs(value);
  const int decimals = size >= 100.0 ? 0 : size >= 10.0 ? 1 : size >= 1.0 ? 2 : 3;
  const std::string text = fmt::format("{:.{}f}", value, decimals);
  return text == "-0.000" ? "0.000" : text;
}

std::string shown(double value, double scale, const char* unit) {
  return std::isfinite(value) ? three_digits(value * scale) + unit : "-";
}

std::string kilopascal(double stress) { return shown(stress, 1e-3, " kPa"); }
std::string percent(double strain) {
  if (!std::isfinite(strain)) return "-";
  const std::string text = fmt::format("{:.2f} %", 100.0 * strain);
  return text == "-0.00 %" ? "0.00 %" : text;
}
std::string plain(double value, int decimals) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, decimals) : "-";
}

std::string wall_time(double seconds) {
  if (!std::isfinite(seconds)) return "-";
  if (seconds < 60.0) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<long>(std::lround(seconds));
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

// Characters, not bytes: titles and reasons are UTF-8.
std::size_t characters(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

std::string shorten(const std::string& text, std::size_t most) {
  if (characters(text) <= most) return text;
  std::string result;
  std::size_t count = 0;
  for (const char c : text) {
    if ((static_cast<unsigned char>(c) & 0xC0) != 0x80 && ++count > most - 2) break;
    result += c;
  }
  return result + "..";
}

// Text in lines of the table's width; lines after the first are indented.
std::string wrapped(const std::string& text) {
  std::istringstream words(text);
  std::string word, line, result;
  while (words >> word) {
    if (!line.empty() && characters(line) + 1 + characters(word) > width) {
      result += line + '\n';
      line = "  " + word;
    } else {
      line += (line.empty() ? "" : " ") + word;
    }
  }
  return result + line + '\n';
}

std::string strength_line(const StageLine& s) {
  std::string line = s.name + ": unconfined strength " + kilopascal(s.strength);
  if (std::isfinite(s.strength_strain)) line += " at strain " + percent(s.strength_strain);
  if (!s.peak_found) line += " (largest stress so far, no peak found)";
  if (std::isfinite(s.initial_stiffness)) line += ", initial stiffness " + kilopascal(s.initial_stiffness);
  return line;
}

}  // namespace

std::string stage_table(const std::vector<StageLine>& stages) {
  constexpr std::size_t columns = 8, name = 0, reason = 1, wall = 7;
  using Cells = std::array<std::string, columns>;
  std::vector<Cells> lines{{"stage", "ended by", "simulated", "stress top", "strain", "porosity", "CN", "wall time"}};
  bool with_wall = false;
  for (const StageLine& s : stages) {
    with_wall = with_wall || std::isfinite(s.wall_seconds);
    lines.push_back({shorten(s.name, 16), s.end_reason, shown(s.time, 1.0, " s"), kilopascal(s.stress_top),
                     percent(s.strain), plain(s.porosity, 3), plain(s.coordination_number, 2),
                     wall_time(s.wall_seconds)});
  }
  if (!with_wall)
    for (Cells& line : lines) line[wall].clear();
  std::array<std::size_t, columns> widths{};
  for (const Cells& line : lines)
    for (std::size_t c = 0; c < columns; ++c) widths[c] = std::max(widths[c], characters(line[c]));
  // The reason takes what the numbers leave.
  std::size_t taken = 0;
  for (std::size_t c = 0; c < columns; ++c)
    if (c != reason && widths[c] > 0) taken += widths[c] + gap;
  widths[reason] = std::min(widths[reason], width - taken);

  std::string result;
  for (const Cells& cells : lines) {
    std::string line;
    for (std::size_t c = 0; c < columns; ++c) {
      if (widths[c] == 0) continue;
      const std::string cell = shorten(cells[c], widths[c]);
      const std::string space(widths[c] - characters(cell), ' ');
      if (!line.empty()) line += std::string(gap, ' ');
      line += c == name || c == reason ? cell + space : space + cell;
    }
    result += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
  }
  for (const StageLine& s : stages)
    if (std::isfinite(s.strength)) result += wrapped(strength_line(s));
  for (const StageLine& s : stages)
    for (const std::string& warning : s.warnings) result += wrapped("warning: " + s.name + ": " + warning);
  return result;
}

std::string summary_table(const std::vector<StageResult>& stages) {
  std::vector<StageLine> lines;
  for (const StageResult& s : stages) {
    const Measures& m = s.last.measures;
    StageLine line;
    line.name = s.name;
    line.end_reason = s.end_reason;
    line.time = s.time_end - s.time_begin;
    line.stress_top = m.stress_top;
    line.strain = s.strain_zero_height ? engineering_strain(*s.strain_zero_height, m.height) : s.last.strain;
    line.porosity = m.porosity;
    line.coordination_number = m.coordination_number;
    line.wall_seconds = s.wall_seconds;
    line.strength = s.strength.value_or(StageLine::none);
    line.strength_strain = s.strength_strain.value_or(StageLine::none);
    line.initial_stiffness = s.initial_stiffness.value_or(StageLine::none);
    line.peak_found = s.peak_found.value_or(false);
    line.warnings = s.warnings;
    lines.push_back(std::move(line));
  }
  return stage_table(lines);
}

}  // namespace platen
