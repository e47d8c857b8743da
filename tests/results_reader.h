// Reads data sets of results.h5 through HDF5's C API, for tests.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

namespace platen::test {

template <class T>
struct Dataset {
  std::vector<hsize_t> shape;
  std::vector<T> values;  // row by row
  T at(std::size_t row, std::size_t column = 0) const {
    return values.at(row * (shape.size() > 1 ? static_cast<std::size_t>(shape[1]) : 1) + column);
  }
  std::size_t rows() const { return shape.empty() ? 0 : static_cast<std::size_t>(shape[0]); }
};

// One HDF5 file, open for reading. Every method throws std::runtime_error naming the file and the object.
class ResultsFile {
 public:
  explicit ResultsFile(const std::filesystem::path& path) : name_(path.string()) {
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // errors are reported by the exceptions below
    file_ = H5Fopen(name_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
    if (file_ < 0) throw std::runtime_error("cannot open " + name_);
  }
  ~ResultsFile() { H5Fclose(file_); }
  ResultsFile(const ResultsFile&) = delete;
  ResultsFile& operator=(const ResultsFile&) = delete;

  bool has(const std::string& path) const {  // every link on the way is looked at: H5Lexists knows only the last one
    for (std::size_t end = path.find('/', 1);; end = path.find('/', end + 1)) {
      if (H5Lexists(file_, path.substr(0, end).c_str(), H5P_DEFAULT) <= 0) return false;
      if (end == std::string::npos) return true;
    }
  }
  Dataset<double> doubles(const std::string& path) const { return read<double>(path, H5T_NATIVE_DOUBLE); }
  Dataset<std::int64_t> integers(const std::string& path) const { return read<std::int64_t>(path, H5T_NATIVE_INT64); }

 private:
  template <class T>
  Dataset<T> read(const std::string& path, hid_t type) const {
    const hid_t set = H5Dopen2(file_, path.c_str(), H5P_DEFAULT);
    if (set < 0) throw std::runtime_error(name_ + ": no data set " + path);
    Dataset<T> data;
    const hid_t space = H5Dget_space(set);
    const int rank = H5Sget_simple_extent_ndims(space);
    data.shape.resize(rank < 0 ? 0 : static_cast<std::size_t>(rank));
    std::size_t count = 1;
    if (!data.shape.empty()) H5Sget_simple_extent_dims(space, data.shape.data(), nullptr);
    for (hsize_t n : data.shape) count *= static_cast<std::size_t>(n);
    data.values.resize(count);
    const herr_t error = count > 0 ? H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data.values.data()) : 0;
    H5Sclose(space);
    H5Dclose(set);
    if (error < 0) throw std::runtime_error(name_ + ": cannot read " + path);
    return data;
  }
  std::string name_;
  hid_t file_ = -1;
};

}  // namespace platen::test
