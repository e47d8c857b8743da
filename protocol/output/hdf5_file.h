// A thin layer over the HDF5 C API: handles that close themselves, errors that are exceptions, and datasets that cannot
// be written without a unit and a description.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "protocol/output/hdf5_driver.h"
#include "protocol/output/output_error.h"

namespace platen {

// Owns any HDF5 identifier.
class Hdf5Id {
 public:
  using Close = herr_t (*)(hid_t);
  Hdf5Id() = default;
  Hdf5Id(hid_t id, Close closer) noexcept : id_(id), close_(closer) {}
  Hdf5Id(Hdf5Id&& other) noexcept
      : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(other.close_) {}
  Hdf5Id& operator=(Hdf5Id&& other) noexcept;
  ~Hdf5Id();
  hid_t get() const noexcept { return id_; }
  herr_t close() noexcept;  // now; 0 when there is nothing to close

 private:
  hid_t id_ = H5I_INVALID_HID;
  Close close_ = nullptr;
};

// Codes of an enumeration with their names.
using Hdf5Codes = std::vector<std::pair<std::string, int>>;

// Unit ("-" without dimension) and meaning, attributes of every dataset.
struct Hdf5Meaning {
  std::string unit;
  std::string description;
};

// What is known of a dataset without reading its values.
struct Hdf5Shape {
  std::vector<std::uint64_t> size;  // per dimension; empty = a single value
  std::string type;                 // "float64", "int32", "enum", "string" ...
};

// A group of an open file. Names are single names or paths below the group. Everything throws OutputError, which names
// the file, the object and HDF5's or the system's reason.
class Hdf5Group {
 public:
  Hdf5Group(Hdf5Id id, std::string where, std::shared_ptr<const WriteFault> fault);

  Hdf5Group create_group(const std::string& name);
  Hdf5Group group(const std::string& name) const;   // an existing one
  bool has(const std::string& name) const;          // a single name
  bool is_group(const std::string& name) const;
  std::vector<std::string> names() const;           // of the members, alphabetical

  // Values in rows of `columns` numbers: shape N (columns = 1) or N x columns. T: double, std::int64_t, std::int32_t, std::uint8_t.
  template <class T>
  void write(const std::string& name, const std::vector<T>& values, int columns, const Hdf5Meaning& meaning);
  // Any shape, last index fastest. T: double, std::int32_t.
  template <class T>
  void write_shaped(const std::string& name, const std::vector<T>& values, const std::vector<std::uint64_t>& shape, const Hdf5Meaning& meaning);
  // An enumeration, shape N. T: std::int8_t or std::int32_t.
  template <class T>
  void write_codes(const std::string& name, const std::vector<T>& values, const Hdf5Codes& codes,
                   const Hdf5Meaning& meaning);
  void write_text(const std::string& name, const std::string& text, const Hdf5Meaning& meaning);  // one UTF-8 string

  template <class T>
  std::vector<T> read(const std::string& name) const;  // all values, row by row
  std::string read_text(const std::string& name) const;
  Hdf5Shape shape(const std::string& name) const;

  void attribute(const std::string& name, const std::string& value);
  void attribute(const std::string& name, const char* value) { attribute(name, std::string(value)); }
  void attribute(const std::string& name, double value);
  void attribute(const std::string& name, std::int64_t value);
  void attribute(const std::string& name, std::uint64_t value);
  void attribute(const std::string& name, bool value);
  void attribute(const std::string& name, const std::vector<std::int64_t>& values);
  void attribute(const std::string& name, const std::vector<std::string>& values);
  void ascii_attribute(const std::string& name, const std::string& value);  // of fixed length, for readers that want it so
  // A text attribute of the member `object` ("." = the group itself); empty when there is none.
  std::string text_attribute(const std::string& object, const std::string& name) const;
  std::int64_t integer_attribute(const std::string& object, const std::string& name, std::int64_t otherwise) const;
  double real_attribute(const std::string& object, const std::string& name, double otherwise) const;

  void copy_from(const Hdf5Group& source, const std::string& name);  // a whole member with all below it
  void link(const Hdf5Group& target, const std::string& name);       // a second name for `target`

 private:
  friend class Hdf5File;
  void check(herr_t result, const std::string& name) const;
  Hdf5Id checked(hid_t id, Hdf5Id::Close closer, const std::string& name) const;
  void check_disk() const;
  void write_dataset(const std::string& name, hid_t file_type, hid_t memory_type, hid_t space, const void* values,
                     const Hdf5Meaning& meaning);
  void write_rows(const std::string& name, hid_t file_type, hid_t memory_type, const void* values, std::size_t count,
                  int columns, const Hdf5Meaning& meaning);
  void write_attribute(hid_t object, const std::string& name, hid_t file_type, hid_t memory_type,
                       const void* value) const;
  void write_text_attribute(hid_t object, const std::string& name, const std::string& value) const;

  Hdf5Id id_;
  std::string where_;  // file and group, for messages
  std::shared_ptr<const WriteFault> fault_;
};

// A file, either new or read only.
class Hdf5File {
 public:
  // A new file. It stands under a temporary name until `close` has found all of it on disk and gives it its final name;
  // without `close` nothing is left of it, and an older file of that name stays.
  static Hdf5File create(const std::filesystem::path& path);
  static Hdf5File open(const std::filesystem::path& path);  // read only
  static bool is_hdf5(const std::filesystem::path& path);
  Hdf5File(Hdf5File&&) = default;
  ~Hdf5File();

  Hdf5Group root() const;
  // Throws OutputError if any write failed. Groups of the file must not be used any more.
  void close();

 private:
  Hdf5File(std::filesystem::path path, std::shared_ptr<WriteFault> fault, Hdf5Id id);
  std::filesystem::path path_;         // the final name
  std::shared_ptr<WriteFault> fault_;  // of a new file; null when read only
  Hdf5Id id_;
};

}  // namespace platen
