// A case file as a tree of values that know where they were written. The only door to the TOML library.
//
//   text --parse_document--> CaseValue --apply_override (each --set)--> CaseValue --sections, stages--> Case
//                                                                          `--to_toml--> case.toml of the run folder
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace platen {

// Where a value or key stands: file:line:column, or `--set KEY=VALUE` (line 0).
struct Position {
  std::string source;
  int line = 0;
  int column = 0;
};
std::string to_string(const Position& position);

struct CaseEntry;

struct CaseValue {
  enum class Type { text, integer, real, boolean, list, table, date };
  Type type = Type::table;
  Position where;
  std::string text;  // text: its characters; date: as written
  std::int64_t integer = 0;
  double real = 0.0;
  bool boolean = false;
  std::vector<CaseValue> items;    // list
  std::vector<CaseEntry> entries;  // table, in the order of the file
  bool guessed = false;            // text that an override gave without quotes

  const CaseEntry* find(std::string_view key) const;  // entry of a table, nullptr if absent
  CaseEntry* find(std::string_view key);
};

struct CaseEntry {
  std::string key;
  Position where;  // of the key
  CaseValue value;
};

const char* type_name(CaseValue::Type type);  // "a string", "a whole number", ...

// The tree of a TOML text; `name` stands in positions. Throws CaseError for a syntax error: its position, what is wrong,
// then the line and a caret under the place.
CaseValue parse_document(const std::string& text, const std::string& name);

// Text of one value in TOML, for messages and for case.toml; numbers read back to the same bits.
std::string to_toml_value(const CaseValue& value);

// The whole tree as a TOML text.
std::string to_toml(const CaseValue& root);

}  // namespace platen
