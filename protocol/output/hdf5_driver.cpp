#include "protocol/output/hdf5_driver.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>

namespace platen {

namespace {

// Property of the access list; HDF5 copies it byte by byte.
struct DriverInfo {
  WriteFault* fault;
};

struct DriverFile {
  H5FD_t base;  // must stand first: HDF5 knows the file by this part only
  int fd;
  haddr_t allocated;  // end of what HDF5 has asked for
  haddr_t end;        // end of the file, as if every write had worked
  WriteFault* fault;
};

DriverFile* as_ours(H5FD_t* file) { return reinterpret_cast<DriverFile*>(file); }
const DriverFile* as_ours(const H5FD_t* file) { return reinterpret_cast<const DriverFile*>(file); }

void remember(WriteFault* fault, int error_number) {
  if (fault->error_number == 0) fault->error_number = error_number;
}

H5FD_t* driver_open(const char* name, unsigned flags, hid_t access, haddr_t) {
  const auto* info = static_cast<const DriverInfo*>(H5Pget_driver_info(access));
  if (info == nullptr) return nullptr;
  int open_flags = O_CLOEXEC | ((flags & H5F_ACC_RDWR) ? O_RDWR : O_RDONLY);
  if (flags & H5F_ACC_TRUNC) open_flags |= O_TRUNC;
  if (flags & H5F_ACC_CREAT) open_flags |= O_CREAT;
  if (flags & H5F_ACC_EXCL) open_flags |= O_EXCL;
  const int fd = ::open(name, open_flags, 0666);
  struct stat status {};
  if (fd < 0 || ::fstat(fd, &status) != 0) {
    remember(info->fault, errno);
    if (fd >= 0) ::close(fd);
    return nullptr;
  }
  auto* file = new (std::nothrow) DriverFile{};
  if (file == nullptr) {
    ::close(fd);
    return nullptr;
  }
  file->fd = fd;
  file->end = static_cast<haddr_t>(status.st_size);
  file->fault = info->fault;
  return &file->base;
}

herr_t driver_close(H5FD_t* base) {
  DriverFile* file = as_ours(base);
  if (::fsync(file->fd) != 0) remember(file->fault, errno);
  if (::close(file->fd) != 0) remember(file->fault, errno);
  delete file;
  return 0;
}

herr_t driver_query(const H5FD_t*, unsigned long* flags) {
  *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
           H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
  return 0;
}

haddr_t driver_allocated(const H5FD_t* file, H5FD_mem_t) { return as_ours(file)->allocated; }

herr_t driver_allocate(H5FD_t* file, H5FD_mem_t, haddr_t address) {
  as_ours(file)->allocated = address;
  return 0;
}

haddr_t driver_end(const H5FD_t* file, H5FD_mem_t) { return as_ours(file)->end; }

// What was never written reads as zeros, as in a file with a hole.
herr_t driver_read(H5FD_t* base, H5FD_mem_t, hid_t, haddr_t address, std::size_t size, void* buffer) {
  auto* to = static_cast<char*>(buffer);
  while (size > 0) {
    const ssize_t n = ::pread(as_ours(base)->fd, to, size, static_cast<off_t>(address));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return -1;
    if (n == 0) {
      std::memset(to, 0, size);
      break;
    }
    to += n;
    address += static_cast<haddr_t>(n);
    size -= static_cast<std::size_t>(n);
  }
  return 0;
}

herr_t driver_write(H5FD_t* base, H5FD_mem_t, hid_t, haddr_t address, std::size_t size, const void* buffer) {
  DriverFile* file = as_ours(base);
  const auto* from = static_cast<const char*>(buffer);
  file->end = std::max(file->end, address + size);
  while (size > 0 && file->fault->error_number == 0) {
    const ssize_t n = ::pwrite(file->fd, from, size, static_cast<off_t>(address));
    if (n < 0) {
      if (errno != EINTR) remember(file->fault, errno);
      continue;
    }
    from += n;
    address += static_cast<haddr_t>(n);
    size -= static_cast<std::size_t>(n);
  }
  return 0;
}

herr_t driver_truncate(H5FD_t* base, hid_t, hbool_t) {
  DriverFile* file = as_ours(base);
  if (file->end != file->allocated) {
    if (file->fault->error_number == 0 && ::ftruncate(file->fd, static_cast<off_t>(file->allocated)) != 0)
      remember(file->fault, errno);
    file->end = file->allocated;
  }
  return 0;
}

H5FD_class_t make_class() {
  H5FD_class_t driver{};
  driver.name = "platen";
  driver.maxaddr = (static_cast<haddr_t>(1) << 62) - 1;
  driver.fc_degree = H5F_CLOSE_STRONG;  // handles left open by an exception do not keep the file open
  driver.fapl_size = sizeof(DriverInfo);
  driver.open = driver_open;
  driver.close = driver_close;
  driver.query = driver_query;
  driver.get_eoa = driver_allocated;
  driver.set_eoa = driver_allocate;
  driver.get_eof = driver_end;
  driver.read = driver_read;
  driver.write = driver_write;
  driver.truncate = driver_truncate;
  const H5FD_mem_t map[H5FD_MEM_NTYPES] = H5FD_FLMAP_DICHOTOMY;
  std::copy(map, map + H5FD_MEM_NTYPES, driver.fl_map);
  return driver;
}

}  // namespace

herr_t use_fault_driver(hid_t file_access, WriteFault* fault) {
  static const H5FD_class_t driver = make_class();
  static const hid_t driver_id = H5FDregister(&driver);
  if (driver_id < 0) return -1;
  const DriverInfo info{fault};
  return H5Pset_driver(file_access, driver_id, &info);
}

}  // namespace platen
