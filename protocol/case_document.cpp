#include "protocol/case_document.h"

#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include "protocol/case_file.h"

namespace platen {
namespace {

// toml++ walks nested tables recursively and does not limit dotted keys, so a line of a hundred thousand dots would
// exhaust the stack. No case needs more than a handful.
constexpr int most_dots_in_a_key = 64;

Position position_of(const toml::source_region& region, const std::string& name) {
  return {name, static_cast<int>(region.begin.line), static_cast<int>(region.begin.column)};
}

bool earlier(const CaseEntry& a, const CaseEntry& b) {
  return std::pair(a.where.line, a.where.column) < std::pair(b.where.line, b.where.column);
}

CaseValue convert(const toml::node& node, const std::string& name) {
  CaseValue value;
  value.where = position_of(node.source(), name);
  switch (node.type()) {
    case toml::node_type::table:
      value.type = CaseValue::Type::table;
      for (const auto& [key, child] : *node.as_table()) {
        value.entries.push_back({std::string(key.str()), position_of(key.source(), name), convert(child, name)});
      }
      // toml++ sorts by name; people read in the order in which they wrote.
      std::stable_sort(value.entries.begin(), value.entries.end(), earlier);
      break;
    case toml::node_type::array:
      value.type = CaseValue::Type::list;
      for (const toml::node& item : *node.as_array()) value.items.push_back(convert(item, name));
      break;
    case toml::node_type::string:
      value.type = CaseValue::Type::text;
      value.text = node.as_string()->get();
      break;
    case toml::node_type::integer:
      value.type = CaseValue::Type::integer;
      value.integer = node.as_integer()->get();
      break;
    case toml::node_type::floating_point:
      value.type = CaseValue::Type::real;
      value.real = node.as_floating_point()->get();
      break;
    case toml::node_type::boolean:
      value.type = CaseValue::Type::boolean;
      value.boolean = node.as_boolean()->get();
      break;
    default: {
      value.type = CaseValue::Type::date;
      std::ostringstream out;
      node.visit([&out](const auto& visited) {
        if constexpr (toml::is_date<decltype(visited)> || toml::is_time<decltype(visited)> ||
                      toml::is_date_time<decltype(visited)>) {
          out << visited.get();
        }
      });
      value.text = out.str();
    }
  }
  return value;
}

std::string line_of(const std::string& text, int line) {
  std::size_t begin = 0;
  for (int i = 1; i < line && begin != std::string::npos; ++i) {
    begin = text.find('\n', begin);
    if (begin != std::string::npos) ++begin;
  }
  if (begin == std::string::npos || begin >= text.size()) return {};
  std::string found = text.substr(begin, text.find('\n', begin) - begin);
  if (!found.empty() && found.back() == '\r') found.pop_back();
  for (char& c : found) {
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';  // a tab would move the caret; control characters would do worse
  }
  return found;
}

[[noreturn]] void throw_syntax_error(const std::string& text, const Position& where, const std::string& what) {
  // Columns count characters, bytes of one UTF-8 character share a column.
  throw CaseError(to_string(where) + ": TOML syntax: " + what + "\n  " + line_of(text, where.line) + "\n  " +
                  std::string(static_cast<std::size_t>(std::max(where.column - 1, 0)), ' ') + "^");
}

// Refuses keys nested so deeply that the parser would run out of stack.
void check_nesting(const std::string& text, const std::string& name) {
  int line = 1, column = 0, dots = 0;
  char quote = '\0';
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    ++column;
    if (c == '\n') {
      ++line;
      column = dots = 0;
      quote = '\0';
    } else if (quote != '\0') {
      if (c == '\\' && quote == '"')
        ++i, ++column;
      else if (c == quote)
        quote = '\0';
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '#') {
      while (i + 1 < text.size() && text[i + 1] != '\n') ++i;
    } else if (std::string_view("=,[]{}").find(c) != std::string_view::npos) {
      dots = 0;
    } else if (c == '.' && ++dots > most_dots_in_a_key) {
      throw_syntax_error(text, {name, line, column}, "a key is nested too deeply");
    }
  }
}

std::string to_toml_text(const std::string& text) {
  std::string out(1, '"');
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      constexpr char hex[] = "0123456789ABCDEF";
      out += "\\u00";
      out += hex[byte >> 4];
      out += hex[byte & 15];
    } else {
      out += c;
    }
  }
  out += '"';
  return out;
}

std::string to_toml_real(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value > 0.0 ? "inf" : "-inf";
  char buffer[40];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);
  std::string out(buffer, end);
  if (out.find_first_of(".e") == std::string::npos) out += ".0";  // else TOML reads a whole number
  return out;
}

std::string to_toml_key(const std::string& key) {
  const bool bare = !key.empty() && std::all_of(key.begin(), key.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
  return bare ? key : to_toml_text(key);
}

bool is_table_list(const CaseValue& value) {
  return value.type == CaseValue::Type::list && !value.items.empty() &&
         std::all_of(value.items.begin(), value.items.end(),
                     [](const CaseValue& item) { return item.type == CaseValue::Type::table; });
}

// Values first, then tables: in TOML a key after a [header] would belong to that header.
void write_table(const CaseValue& table, const std::string& path, std::string& out) {
  for (const CaseEntry& entry : table.entries) {
    if (entry.value.type == CaseValue::Type::table || is_table_list(entry.value)) continue;
    out += to_toml_key(entry.key) + " = " + to_toml_value(entry.value) + "\n";
  }
  for (const CaseEntry& entry : table.entries) {
    const std::string inner = (path.empty() ? "" : path + ".") + to_toml_key(entry.key);
    if (entry.value.type == CaseValue::Type::table) {
      out += "\n[" + inner + "]\n";
      write_table(entry.value, inner, out);
    } else if (is_table_list(entry.value)) {
      for (const CaseValue& item : entry.value.items) {
        out += "\n[[" + inner + "]]\n";
        write_table(item, inner, out);
      }
    }
  }
}

}  // namespace

std::string to_string(const Position& position) {
  if (position.line == 0) return position.source;
  return position.source + ":" + std::to_string(position.line) + ":" + std::to_string(position.column);
}

const CaseEntry* CaseValue::find(std::string_view key) const {
  const auto found = std::find_if(entries.begin(), entries.end(), [key](const CaseEntry& e) { return e.key == key; });
  return found == entries.end() ? nullptr : &*found;
}

CaseEntry* CaseValue::find(std::string_view key) {
  return const_cast<CaseEntry*>(static_cast<const CaseValue*>(this)->find(key));
}

const char* type_name(CaseValue::Type type) {
  switch (type) {
    case CaseValue::Type::text:
      return "a string";
    case CaseValue::Type::integer:
      return "a whole number";
    case CaseValue::Type::real:
      return "a real number";
    case CaseValue::Type::boolean:
      return "true or false";
    case CaseValue::Type::list:
      return "a list";
    case CaseValue::Type::table:
      return "a table";
    case CaseValue::Type::date:
      return "a date or time of day";
  }
  return "";
}

CaseValue parse_document(const std::string& text, const std::string& name) {
  check_nesting(text, name);
  try {
    return convert(toml::parse(std::string_view(text), std::string_view(name)), name);
  } catch (const toml::parse_error& error) {
    throw_syntax_error(text, position_of(error.source(), name), std::string(error.description()));
  }
}

std::string to_toml_value(const CaseValue& value) {
  switch (value.type) {
    case CaseValue::Type::text:
      return to_toml_text(value.text);
    case CaseValue::Type::integer:
      return std::to_string(value.integer);
    case CaseValue::Type::real:
      return to_toml_real(value.real);
    case CaseValue::Type::boolean:
      return value.boolean ? "true" : "false";
    case CaseValue::Type::date:
      return value.text;
    case CaseValue::Type::list: {
      std::string out = "[";
      for (const CaseValue& item : value.items) out += (out.size() > 1 ? ", " : "") + to_toml_value(item);
      return out + "]";
    }
    case CaseValue::Type::table: {
      std::string out = "{ ";
      for (const CaseEntry& entry : value.entries) {
        out += (out.size() > 2 ? ", " : "") + to_toml_key(entry.key) + " = " + to_toml_value(entry.value);
      }
      return out + " }";
    }
  }
  return {};
}

std::string to_toml(const CaseValue& root) {
  std::string out;
  write_table(root, "", out);
  return out;
}

}  // namespace platen
