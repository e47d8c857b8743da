#include "protocol/output/hdf5_file.h"

#include <unistd.h>

#include <array>
#include <cstring>

#include "protocol/output/files.h"

namespace platen {

namespace {

// HDF5 prints its errors by itself unless told otherwise; the setting belongs to the calling thread.
void silence() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

// The deepest entry of HDF5's error stack: the cause.
std::string hdf5_reason() {
  std::string reason;
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_UPWARD,
      [](unsigned, const H5E_error2_t* entry, void* text) -> herr_t {
        auto& out = *static_cast<std::string*>(text);
        if (out.empty() && entry->desc != nullptr) out = entry->desc;
        return 0;
      },
      &reason);
  H5Eclear2(H5E_DEFAULT);
  return reason.empty() ? "HDF5 gives no reason" : "HDF5: " + reason;
}

template <class T>
hid_t memory_type();
template <>
hid_t memory_type<double>() { return H5T_NATIVE_DOUBLE; }
template <>
hid_t memory_type<std::int64_t>() { return H5T_NATIVE_INT64; }
template <>
hid_t memory_type<std::int32_t>() { return H5T_NATIVE_INT32; }
template <>
hid_t memory_type<std::uint8_t>() { return H5T_NATIVE_UINT8; }
template <>
hid_t memory_type<std::int8_t>() { return H5T_NATIVE_INT8; }

template <class T>
hid_t file_type();
template <>
hid_t file_type<double>() { return H5T_IEEE_F64LE; }
template <>
hid_t file_type<std::int64_t>() { return H5T_STD_I64LE; }
template <>
hid_t file_type<std::int32_t>() { return H5T_STD_I32LE; }
template <>
hid_t file_type<std::uint8_t>() { return H5T_STD_U8LE; }
template <>
hid_t file_type<std::int8_t>() { return H5T_STD_I8LE; }

Hdf5Id text_type() {
  Hdf5Id type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), H5T_VARIABLE);
  H5Tset_cset(type.get(), H5T_CSET_UTF8);
  return type;
}

std::string type_name(hid_t type) {
  const std::string bits = std::to_string(8 * H5Tget_size(type));
  switch (H5Tget_class(type)) {
    case H5T_FLOAT: return "float" + bits;
    case H5T_INTEGER: return (H5Tget_sign(type) == H5T_SGN_NONE ? "uint" : "int") + bits;
    case H5T_ENUM: return "enum";
    case H5T_STRING: return "string";
    case H5T_COMPOUND: return "compound";
    default: return "other";
  }
}

}  // namespace

Hdf5Id& Hdf5Id::operator=(Hdf5Id&& other) noexcept {
  std::swap(id_, other.id_);
  std::swap(close_, other.close_);
  return *this;
}

Hdf5Id::~Hdf5Id() { close(); }

herr_t Hdf5Id::close() noexcept {
  const hid_t id = std::exchange(id_, H5I_INVALID_HID);
  return id >= 0 && close_ != nullptr ? close_(id) : 0;
}

// ---- group ----------------------------------------------------------------------------------------------------------

Hdf5Group::Hdf5Group(Hdf5Id id, std::string where, std::shared_ptr<const WriteFault> fault)
    : id_(std::move(id)), where_(std::move(where)), fault_(std::move(fault)) {}

void Hdf5Group::check(herr_t result, const std::string& name) const {
  if (result < 0) throw OutputError(where_ + name + ": " + hdf5_reason());
}

Hdf5Id Hdf5Group::checked(hid_t id, Hdf5Id::Close closer, const std::string& name) const {
  check(id < 0 ? -1 : 0, name);
  return Hdf5Id(id, closer);
}

// Ends a lost file early instead of at its close.
void Hdf5Group::check_disk() const {
  if (fault_ && fault_->error_number != 0)
    throw OutputError(where_ + ": cannot write: " + std::strerror(fault_->error_number));
}

Hdf5Group Hdf5Group::create_group(const std::string& name) {
  Hdf5Id id = checked(H5Gcreate2(id_.get(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose, name);
  return Hdf5Group(std::move(id), where_ + name + "/", fault_);
}

Hdf5Group Hdf5Group::group(const std::string& name) const {
  return Hdf5Group(checked(H5Gopen2(id_.get(), name.c_str(), H5P_DEFAULT), H5Gclose, name), where_ + name + "/", fault_);
}

bool Hdf5Group::has(const std::string& name) const {
  const htri_t there = H5Lexists(id_.get(), name.c_str(), H5P_DEFAULT);
  check(there, name);
  return there > 0;
}

bool Hdf5Group::is_group(const std::string& name) const {
  H5O_info_t info{};
  check(H5Oget_info_by_name(id_.get(), name.c_str(), &info, H5P_DEFAULT), name);
  return info.type == H5O_TYPE_GROUP;
}

std::vector<std::string> Hdf5Group::names() const {
  std::vector<std::string> result;
  check(H5Literate(
            id_.get(), H5_INDEX_NAME, H5_ITER_INC, nullptr,
            [](hid_t, const char* name, const H5L_info_t*, void* list) -> herr_t {
              static_cast<std::vector<std::string>*>(list)->emplace_back(name);
              return 0;
            },
            &result),
        "");
  return result;
}

void Hdf5Group::write_dataset(const std::string& name, hid_t file, hid_t memory, hid_t space, const void* values,
                              const Hdf5Meaning& meaning) {
  // Times of writing would make two files with the same contents differ.
  const Hdf5Id options = checked(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, name);
  check(H5Pset_obj_track_times(options.get(), false), name);
  const Hdf5Id dataset = checked(
      H5Dcreate2(id_.get(), name.c_str(), file, space, H5P_DEFAULT, options.get(), H5P_DEFAULT), H5Dclose, name);
  if (H5Sget_simple_extent_npoints(space) > 0)
    check(H5Dwrite(dataset.get(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), name);
  write_text_attribute(dataset.get(), "unit", meaning.unit);
  write_text_attribute(dataset.get(), "description", meaning.description);
  check_disk();
}

void Hdf5Group::write_rows(const std::string& name, hid_t file, hid_t memory, const void* values, std::size_t count,
                           int columns, const Hdf5Meaning& meaning) {
  const std::array<hsize_t, 2> size{count / static_cast<std::size_t>(columns), static_cast<hsize_t>(columns)};
  const Hdf5Id space = checked(H5Screate_simple(columns > 1 ? 2 : 1, size.data(), nullptr), H5Sclose, name);
  write_dataset(name, file, memory, space.get(), values, meaning);
}

template <class T>
void Hdf5Group::write(const std::string& name, const std::vector<T>& values, int columns, const Hdf5Meaning& meaning) {
  write_rows(name, file_type<T>(), memory_type<T>(), values.data(), values.size(), columns, meaning);
}
template void Hdf5Group::write(const std::string&, const std::vector<double>&, int, const Hdf5Meaning&);
template void Hdf5Group::write(const std::string&, const std::vector<std::int64_t>&, int, const Hdf5Meaning&);
template void Hdf5Group::write(const std::string&, const std::vector<std::int32_t>&, int, const Hdf5Meaning&);
template void Hdf5Group::write(const std::string&, const std::vector<std::uint8_t>&, int, const Hdf5Meaning&);

template <class T>
void Hdf5Group::write_shaped(const std::string& name, const std::vector<T>& values, const std::vector<std::uint64_t>& shape, const Hdf5Meaning& meaning) {
  const std::vector<hsize_t> size(shape.begin(), shape.end());
  const Hdf5Id space = checked(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr), H5Sclose, name);
  write_dataset(name, file_type<T>(), memory_type<T>(), space.get(), values.data(), meaning);
}
template void Hdf5Group::write_shaped(const std::string&, const std::vector<double>&, const std::vector<std::uint64_t>&, const Hdf5Meaning&);
template void Hdf5Group::write_shaped(const std::string&, const std::vector<std::int32_t>&, const std::vector<std::uint64_t>&, const Hdf5Meaning&);

template <class T>
void Hdf5Group::write_codes(const std::string& name, const std::vector<T>& values, const Hdf5Codes& codes,
                            const Hdf5Meaning& meaning) {
  const Hdf5Id type = checked(H5Tenum_create(file_type<T>()), H5Tclose, name);
  Hdf5Meaning with_codes = meaning;
  const char* separator = "; codes: ";
  for (const auto& [word, code] : codes) {
    const T value = static_cast<T>(code);
    check(H5Tenum_insert(type.get(), word.c_str(), &value), name);
    with_codes.description += separator + std::to_string(code) + " " + word;
    separator = ", ";
  }
  // An enumeration in the file's byte order is read and written as such: every machine that runs platen is little-endian.
  write_rows(name, type.get(), type.get(), values.data(), values.size(), 1, with_codes);
}
template void Hdf5Group::write_codes(const std::string&, const std::vector<std::int8_t>&, const Hdf5Codes&,
                                     const Hdf5Meaning&);
template void Hdf5Group::write_codes(const std::string&, const std::vector<std::int32_t>&, const Hdf5Codes&,
                                     const Hdf5Meaning&);

void Hdf5Group::write_text(const std::string& name, const std::string& text, const Hdf5Meaning& meaning) {
  const Hdf5Id type = text_type();
  const Hdf5Id space = checked(H5Screate(H5S_SCALAR), H5Sclose, name);
  const char* value = text.c_str();
  write_dataset(name, type.get(), type.get(), space.get(), &value, meaning);
}

template <class T>
std::vector<T> Hdf5Group::read(const std::string& name) const {
  const Hdf5Id dataset = checked(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT), H5Dclose, name);
  const Hdf5Id space = checked(H5Dget_space(dataset.get()), H5Sclose, name);
  const Hdf5Id type = checked(H5Dget_type(dataset.get()), H5Tclose, name);
  const hssize_t count = H5Sget_simple_extent_npoints(space.get());
  check(count < 0 ? -1 : 0, name);
  std::vector<T> values(static_cast<std::size_t>(count));
  // An enumeration converts to nothing but itself, so its codes are read as they stand.
  const bool codes = H5Tget_class(type.get()) == H5T_ENUM;
  if (codes && H5Tget_size(type.get()) != sizeof(T)) throw OutputError(where_ + name + ": codes of another size");
  if (count > 0)
    check(H5Dread(dataset.get(), codes ? type.get() : memory_type<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()),
          name);
  return values;
}
template std::vector<double> Hdf5Group::read(const std::string&) const;
template std::vector<std::int64_t> Hdf5Group::read(const std::string&) const;
template std::vector<std::int32_t> Hdf5Group::read(const std::string&) const;
template std::vector<std::int8_t> Hdf5Group::read(const std::string&) const;

std::string Hdf5Group::read_text(const std::string& name) const {
  const Hdf5Id dataset = checked(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT), H5Dclose, name);
  const Hdf5Id type = text_type();
  char* value = nullptr;
  check(H5Dread(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, &value), name);
  std::string text = value == nullptr ? "" : value;
  H5free_memory(value);
  return text;
}

Hdf5Shape Hdf5Group::shape(const std::string& name) const {
  const Hdf5Id dataset = checked(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT), H5Dclose, name);
  const Hdf5Id space = checked(H5Dget_space(dataset.get()), H5Sclose, name);
  const Hdf5Id type = checked(H5Dget_type(dataset.get()), H5Tclose, name);
  const int rank = H5Sget_simple_extent_ndims(space.get());
  check(rank, name);
  std::vector<hsize_t> size(static_cast<std::size_t>(rank));
  check(H5Sget_simple_extent_dims(space.get(), size.data(), nullptr), name);
  return {{size.begin(), size.end()}, type_name(type.get())};
}

// ---- attributes -----------------------------------------------------------------------------------------------------

void Hdf5Group::write_attribute(hid_t object, const std::string& name, hid_t file, hid_t memory,
                                const void* value) const {
  const Hdf5Id space = checked(H5Screate(H5S_SCALAR), H5Sclose, name);
  const Hdf5Id attribute =
      checked(H5Acreate2(object, name.c_str(), file, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose, name);
  check(H5Awrite(attribute.get(), memory, value), name);
}

void Hdf5Group::write_text_attribute(hid_t object, const std::string& name, const std::string& value) const {
  const Hdf5Id type = text_type();
  const char* text = value.c_str();
  write_attribute(object, name, type.get(), type.get(), &text);
}

void Hdf5Group::attribute(const std::string& name, const std::string& value) {
  write_text_attribute(id_.get(), name, value);
}
void Hdf5Group::attribute(const std::string& name, double value) {
  write_attribute(id_.get(), name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, &value);
}
void Hdf5Group::attribute(const std::string& name, std::int64_t value) {
  write_attribute(id_.get(), name, H5T_STD_I64LE, H5T_NATIVE_INT64, &value);
}
void Hdf5Group::attribute(const std::string& name, std::uint64_t value) {
  write_attribute(id_.get(), name, H5T_STD_U64LE, H5T_NATIVE_UINT64, &value);
}

void Hdf5Group::attribute(const std::string& name, const std::vector<std::int64_t>& values) {
  const hsize_t size = values.size();
  const Hdf5Id space = checked(H5Screate_simple(1, &size, nullptr), H5Sclose, name);
  const Hdf5Id attribute = checked(H5Acreate2(id_.get(), name.c_str(), H5T_STD_I64LE, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose, name);
  check(H5Awrite(attribute.get(), H5T_NATIVE_INT64, values.data()), name);
}

void Hdf5Group::attribute(const std::string& name, const std::vector<std::string>& values) {
  const Hdf5Id type = text_type();
  const hsize_t size = values.size();
  const Hdf5Id space = checked(H5Screate_simple(1, &size, nullptr), H5Sclose, name);
  const Hdf5Id attribute = checked(H5Acreate2(id_.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose, name);
  std::vector<const char*> texts;
  for (const std::string& value : values) texts.push_back(value.c_str());
  check(H5Awrite(attribute.get(), type.get(), texts.data()), name);
}

void Hdf5Group::ascii_attribute(const std::string& name, const std::string& value) {
  const Hdf5Id type = checked(H5Tcopy(H5T_C_S1), H5Tclose, name);
  check(H5Tset_size(type.get(), value.size()), name);
  check(H5Tset_strpad(type.get(), H5T_STR_NULLPAD), name);
  write_attribute(id_.get(), name, type.get(), type.get(), value.data());
}

void Hdf5Group::attribute(const std::string& name, bool value) {
  // The form in which h5py keeps truth values.
  const Hdf5Id type = checked(H5Tenum_create(H5T_STD_I8LE), H5Tclose, name);
  const std::int8_t no = 0, yes = 1;
  check(H5Tenum_insert(type.get(), "FALSE", &no), name);
  check(H5Tenum_insert(type.get(), "TRUE", &yes), name);
  write_attribute(id_.get(), name, type.get(), type.get(), value ? &yes : &no);
}

std::string Hdf5Group::text_attribute(const std::string& object, const std::string& name) const {
  const htri_t there = H5Aexists_by_name(id_.get(), object.c_str(), name.c_str(), H5P_DEFAULT);
  check(there, object);
  if (there == 0) return {};
  const Hdf5Id attribute = checked(
      H5Aopen_by_name(id_.get(), object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose, object);
  const Hdf5Id stored = checked(H5Aget_type(attribute.get()), H5Tclose, object);
  if (H5Tget_class(stored.get()) != H5T_STRING) return {};
  if (H5Tis_variable_str(stored.get()) > 0) {
    char* value = nullptr;
    check(H5Aread(attribute.get(), stored.get(), &value), object);
    std::string text = value == nullptr ? "" : value;
    H5free_memory(value);
    return text;
  }
  std::string text(H5Tget_size(stored.get()), '\0');
  check(H5Aread(attribute.get(), stored.get(), text.data()), object);
  return text.substr(0, text.find('\0'));
}

std::int64_t Hdf5Group::integer_attribute(const std::string& object, const std::string& name,
                                          std::int64_t otherwise) const {
  const htri_t there = H5Aexists_by_name(id_.get(), object.c_str(), name.c_str(), H5P_DEFAULT);
  check(there, object);
  if (there == 0) return otherwise;
  const Hdf5Id attribute = checked(
      H5Aopen_by_name(id_.get(), object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose, object);
  std::int64_t value = otherwise;
  check(H5Aread(attribute.get(), H5T_NATIVE_INT64, &value), object);
  return value;
}

double Hdf5Group::real_attribute(const std::string& object, const std::string& name, double otherwise) const {
  const htri_t there = H5Aexists_by_name(id_.get(), object.c_str(), name.c_str(), H5P_DEFAULT);
  check(there, object);
  if (there == 0) return otherwise;
  const Hdf5Id attribute = checked(H5Aopen_by_name(id_.get(), object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose, object);
  double value = otherwise;
  check(H5Aread(attribute.get(), H5T_NATIVE_DOUBLE, &value), object);
  return value;
}

void Hdf5Group::copy_from(const Hdf5Group& source, const std::string& name) {
  check(H5Ocopy(source.id_.get(), name.c_str(), id_.get(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), name);
  check_disk();
}

void Hdf5Group::link(const Hdf5Group& target, const std::string& name) {
  check(H5Lcreate_hard(target.id_.get(), ".", id_.get(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), name);
}

// ---- file -----------------------------------------------------------------------------------------------------------

Hdf5File::Hdf5File(std::filesystem::path path, std::shared_ptr<WriteFault> fault, Hdf5Id id)
    : path_(std::move(path)), fault_(std::move(fault)), id_(std::move(id)) {}

Hdf5File::~Hdf5File() {
  // A new file that was never closed is incomplete.
  if (fault_) {
    id_.close();
    ::unlink(temporary_name(path_).c_str());
  }
}

Hdf5File Hdf5File::create(const std::filesystem::path& path) {
  silence();
  auto fault = std::make_shared<WriteFault>();
  const Hdf5Id access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  if (access.get() < 0 || use_fault_driver(access.get(), fault.get()) < 0)
    throw OutputError(path.string() + ": " + hdf5_reason());
  Hdf5File file(path, fault, Hdf5Id(H5Fcreate(temporary_name(path).c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.get()),
                                    H5Fclose));
  if (fault->error_number != 0) throw system_error(path, "cannot write", fault->error_number);
  if (file.id_.get() < 0) throw OutputError(path.string() + ": cannot write: " + hdf5_reason());
  return file;
}

Hdf5File Hdf5File::open(const std::filesystem::path& path) {
  silence();
  Hdf5Id id(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (id.get() < 0) throw OutputError(path.string() + ": cannot read: " + hdf5_reason());
  return Hdf5File(path, nullptr, std::move(id));
}

bool Hdf5File::is_hdf5(const std::filesystem::path& path) {
  silence();
  const bool result = H5Fis_hdf5(path.c_str()) > 0;
  H5Eclear2(H5E_DEFAULT);
  return result;
}

Hdf5Group Hdf5File::root() const {
  Hdf5Id id(H5Gopen2(id_.get(), "/", H5P_DEFAULT), H5Gclose);
  if (id.get() < 0) throw OutputError(path_.string() + ": " + hdf5_reason());
  return Hdf5Group(std::move(id), path_.string() + ": /", fault_);
}

void Hdf5File::close() {
  const herr_t result = id_.close();
  const std::shared_ptr<WriteFault> fault = std::move(fault_);
  if (!fault) return;
  const std::filesystem::path temporary = temporary_name(path_);
  if (fault->error_number == 0 && result >= 0) {
    rename_into_place(temporary, path_);
    return;
  }
  ::unlink(temporary.c_str());
  if (fault->error_number != 0) throw system_error(path_, "cannot write", fault->error_number);
  throw OutputError(path_.string() + ": cannot write: " + hdf5_reason());
}

}  // namespace platen
