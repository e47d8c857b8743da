#include "protocol/particle_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <unordered_map>

#include <fmt/format.h>

#include "protocol/case_reader.h"

namespace platen {
namespace {

constexpr std::size_t most_problems = 20;

enum Column : std::size_t { id, x, y, z, radius, vx, vy, vz, wx, wy, wz, density, column_count };
constexpr std::array<std::string_view, column_count> column_names{"id", "x",  "y",  "z",  "radius", "vx",
                                                                  "vy", "vz", "wx", "wy", "wz",     "density"};

std::string_view trim(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> cells;
  for (;;) {
    const std::size_t comma = line.find(',');
    cells.push_back(trim(line.substr(0, comma)));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

// A cell for a message: short, and without bytes that would harm a terminal.
std::string shown(std::string_view cell) {
  std::string out = "\"";
  for (const char c : cell.substr(0, 40)) out += (c >= 0x20 && c < 0x7f) ? c : '?';
  return out + (cell.size() > 40 ? "...\"" : "\"");
}

template <class Number>
std::errc read_number(std::string_view cell, Number& value) {
  if (cell.size() > 1 && cell.front() == '+' && cell[1] != '-') cell.remove_prefix(1);
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc()) return error;
  return end == cell.data() + cell.size() ? std::errc() : std::errc::invalid_argument;
}

class Parser {
 public:
  Parser(const std::string& name, std::optional<double> default_radius, std::optional<double> default_density)
      : name_(name), default_radius_(default_radius), default_density_(default_density) {}

  ParticleFile parse(std::string_view bytes) {
    if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);  // byte order mark of some spreadsheets
    std::size_t line = 0;
    bool header_read = false;
    while (!bytes.empty() && !stopped_) {
      const std::size_t end = bytes.find('\n');
      const std::string_view text = trim(bytes.substr(0, end));
      bytes.remove_prefix(end == std::string_view::npos ? bytes.size() : end + 1);
      ++line;
      if (text.empty() || text.front() == '#') continue;
      if (header_read) {
        row(text, line);
      } else {
        header(text, line);
        header_read = true;
        if (!file_.problems.empty()) return std::move(file_);  // without a header no row has a meaning
      }
    }
    if (!header_read) {
      problem(1, fmt::format("the file has no header; allowed: {}", fmt::join(column_names, ",")));
    } else if (file_.table.size() == 0 && file_.problems.empty()) {
      problem(line, "the file has no particles; allowed: one row for each after the header");
    }
    if (file_.problems.empty()) refuse_repeated_ids();
    return std::move(file_);
  }

 private:
  void problem(std::size_t line, const std::string& what) {
    if (file_.problems.size() < most_problems) {
      file_.problems.push_back(fmt::format("{}:{}: {}", name_, line, what));
    } else if (!stopped_) {
      file_.problems.push_back(
          fmt::format("{}: more rows are wrong; only the first {} are named", name_, most_problems));
      stopped_ = true;
    }
  }

  void header(std::string_view text, std::size_t line) {
    for (const std::string_view cell : split(text)) {
      const auto found = std::find(column_names.begin(), column_names.end(), cell);
      if (found == column_names.end()) {
        const std::string near = nearest_word(cell, std::vector<std::string>(column_names.begin(), column_names.end()));
        problem(line, fmt::format("unknown column {}; allowed: {}{}", shown(cell), fmt::join(column_names, ","),
                                  near.empty() ? "" : "; nearest known column: " + near));
        continue;
      }
      const auto column = static_cast<Column>(found - column_names.begin());
      if (has(column)) {
        problem(line, fmt::format("column {} appears twice; allowed: each name once", cell));
        continue;
      }
      columns_.push_back(column);
    }
    for (const Column column : {x, y, z}) {
      if (!has(column))
        problem(line, fmt::format("column {} is missing; allowed: a header with x, y and z", column_names[column]));
    }
    if (!has(radius) && !default_radius_) {
      problem(line, "column radius is missing; allowed: a column, or particles.radius in the case");
    }
    if (!has(density) && !default_density_) {
      problem(line, "column density is missing; allowed: a column, or particles.density in the case");
    }
  }

  bool has(Column column) const { return std::find(columns_.begin(), columns_.end(), column) != columns_.end(); }

  void row(std::string_view text, std::size_t line) {
    const std::vector<std::string_view> cells = split(text);
    if (cells.size() != columns_.size()) {
      problem(line, fmt::format("{} cells, but the header has {}; allowed: one cell for each column", cells.size(),
                                columns_.size()));
      return;
    }
    std::array<double, column_count> value{};
    value[radius] = default_radius_.value_or(0.0);
    value[density] = default_density_.value_or(0.0);
    std::int64_t number = static_cast<std::int64_t>(file_.table.size());
    bool good = true;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const Column column = columns_[i];
      const std::string_view column_name = column_names[column];
      if (column == id) {
        if (read_number(cells[i], number) != std::errc() || number < 0) {
          problem(line, fmt::format("id: {} is not a whole number from 0 on", shown(cells[i])));
          good = false;
        }
        continue;
      }
      const std::errc error = read_number(cells[i], value[column]);
      if (error == std::errc::invalid_argument) {
        problem(line, fmt::format("{}: {} is not a number; allowed: a plain number in SI units", column_name,
                                  shown(cells[i])));
        good = false;
      } else if (error != std::errc() || !std::isfinite(value[column])) {
        problem(line, fmt::format("{}: {} is not a finite number that fits; allowed: a plain number in SI units",
                                  column_name, shown(cells[i])));
        good = false;
      } else if ((column == radius || column == density) && value[column] <= 0.0) {
        problem(line, fmt::format("{}: {} is out of range; allowed: > 0", column_name, shown(cells[i])));
        good = false;
      }
    }
    if (!good) return;
    ParticleTable& t = file_.table;
    t.id.push_back(number);
    t.x.push_back(value[x]), t.y.push_back(value[y]), t.z.push_back(value[z]);
    t.radius.push_back(value[radius]);
    t.vx.push_back(value[vx]), t.vy.push_back(value[vy]), t.vz.push_back(value[vz]);
    t.wx.push_back(value[wx]), t.wy.push_back(value[wy]), t.wz.push_back(value[wz]);
    t.density.push_back(value[density]);
    file_.line.push_back(line);
  }

  void refuse_repeated_ids() {
    std::unordered_map<std::int64_t, std::size_t> first;
    for (std::size_t i = 0; i < file_.table.size(); ++i) {
      const auto [place, fresh] = first.emplace(file_.table.id[i], i);
      if (!fresh) {
        problem(file_.line[i], fmt::format("id: {} is used twice, first in line {}; allowed: each id once",
                                           file_.table.id[i], file_.line[place->second]));
      }
      if (stopped_) return;
    }
  }

  std::string name_;
  std::optional<double> default_radius_, default_density_;
  std::vector<Column> columns_;
  ParticleFile file_;
  bool stopped_ = false;
};

}  // namespace

ParticleFile parse_particle_file(std::string_view bytes, const std::string& name, std::optional<double> default_radius,
                                 std::optional<double> default_density) {
  return Parser(name, default_radius, default_density).parse(bytes);
}

}  // namespace platen
