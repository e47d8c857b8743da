#include "protocol/output/series_csv.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>

namespace platen {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

std::string header() {
  std::string line;
  for (const SeriesColumn& column : series_columns()) {
    if (!line.empty()) line += ',';
    line += std::string(column.name) + " [" + column.unit + "]";
  }
  return line + '\n';
}

// A number as its shortest 17-digit form, which reads back to the same bits.
void add_number(std::string& line, double value) {
  char text[32];
  const int n = std::snprintf(text, sizeof text, "%.17g", value);
  line.append(text, static_cast<std::size_t>(n));
}

// Text of a cell, in quotes where a comma or a quote asks for it.
void add_text(std::string& line, const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) {
    line += text;
    return;
  }
  line += '"';
  for (const char c : text) {
    if (c == '"') line += '"';
    line += (c == '\n' || c == '\r') ? ' ' : c;  // a row is a line
  }
  line += '"';
}

std::vector<std::string> split_cells(std::string_view line) {
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quoted && c == '"' && i + 1 < line.size() && line[i + 1] == '"') {
      cells.back() += '"';
      ++i;
    } else if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

// The values of a row (NaN for the stage and for empty cells), or nothing when a cell is no number.
std::optional<std::vector<double>> parse_values(const std::vector<std::string>& cells) {
  const auto columns = series_columns();
  if (cells.size() != columns.size()) return std::nullopt;
  std::vector<double> values(columns.size(), nan);
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (columns[c].value == nullptr || cells[c].empty()) continue;
    char* end = nullptr;
    values[c] = std::strtod(cells[c].c_str(), &end);
    if (*end != '\0') return std::nullopt;
  }
  return values;
}

void add_row(SeriesTable& table, const std::vector<double>& values, const std::string& name, std::size_t stage) {
  if (table.stage_names.size() <= stage) table.stage_names.resize(stage + 1);
  table.stage_names[stage] = name;
  table.stage.push_back(static_cast<int>(stage));
  for (std::size_t c = 0; c < values.size(); ++c)
    if (series_columns()[c].value != nullptr) table.columns[c].push_back(values[c]);
}

SeriesTable empty_table() {
  SeriesTable table;
  table.columns.resize(series_columns().size());
  return table;
}

}  // namespace

SeriesTable read_series(const std::filesystem::path& path, std::optional<std::size_t> rows) {
  const std::string text = read_whole_file(path);
  const std::string first = header();
  if (text.compare(0, first.size(), first) != 0)
    throw OutputError(path.string() + ":1: not the columns that this version of platen writes");
  SeriesTable table = empty_table();
  const std::size_t stage_cell = series_column("stage");
  std::size_t begin = first.size();
  while (!rows || table.rows() < *rows) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string::npos) break;  // the end, or a torn last line
    const auto cells = split_cells(std::string_view(text).substr(begin, end - begin));
    const auto values = parse_values(cells);
    if (!values) throw OutputError(path.string() + ":" + std::to_string(table.rows() + 2) + ": damaged row");
    // Stages come one after the other and each has rows, so their order of appearance is their number.
    const auto& names = table.stage_names;
    const auto known = std::find(names.begin(), names.end(), cells[stage_cell]);
    add_row(table, *values, cells[stage_cell], static_cast<std::size_t>(known - names.begin()));
    begin = end + 1;
  }
  if (rows && table.rows() < *rows)
    throw OutputError(path.string() + ": holds " + std::to_string(table.rows()) + " whole rows where " +
                      std::to_string(*rows) + " are expected");
  table.bytes = begin;
  return table;
}

SeriesFile SeriesFile::create(const std::filesystem::path& path) {
  SeriesFile series(AppendFile::create(path), empty_table());
  series.file_.append(header());
  series.table_.bytes = header().size();
  return series;
}

SeriesFile SeriesFile::reopen(const std::filesystem::path& path, std::optional<std::size_t> rows) {
  SeriesTable table = read_series(path, rows);
  AppendFile file = AppendFile::reopen(path, table.bytes);
  return SeriesFile(std::move(file), std::move(table));
}

void SeriesFile::append(const SeriesRow& row, int stage) {
  const auto columns = series_columns();
  std::vector<double> values(columns.size(), nan);
  std::string line;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (c > 0) line += ',';
    if (columns[c].value == nullptr) {
      add_text(line, row.stage);
      continue;
    }
    values[c] = columns[c].value(row);
    if (!std::isnan(values[c])) add_number(line, values[c]);
  }
  line += '\n';
  file_.append(line);
  table_.bytes += line.size();
  add_row(table_, values, row.stage, static_cast<std::size_t>(stage));
}

}  // namespace platen
