#include "protocol/output/files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace platen {

namespace {

// Writes all bytes; 0 or the errno of the failure.
int write_all(int fd, std::string_view text) {
  while (!text.empty()) {
    const ssize_t n = ::write(fd, text.data(), text.size());
    if (n < 0) {
      if (errno == EINTR) continue;
      return errno;
    }
    text.remove_prefix(static_cast<std::size_t>(n));
  }
  return 0;
}

UniqueFd open_file(const std::filesystem::path& path, int flags) {
  UniqueFd fd(::open(path.c_str(), flags | O_CLOEXEC, 0666));
  if (fd.get() < 0) throw system_error(path, "cannot open", errno);
  return fd;
}

}  // namespace

UniqueFd& UniqueFd::operator=(UniqueFd&& other) noexcept {
  if (this != &other) {
    if (fd_ >= 0) ::close(fd_);
    fd_ = other.release();
  }
  return *this;
}

UniqueFd::~UniqueFd() {
  if (fd_ >= 0) ::close(fd_);
}

int UniqueFd::release() noexcept { return std::exchange(fd_, -1); }

OutputError system_error(const std::filesystem::path& path, const std::string& what, int error_number) {
  return OutputError(path.string() + ": " + what + ": " + std::strerror(error_number));
}

std::filesystem::path temporary_name(const std::filesystem::path& path) {
  return std::filesystem::path(path).concat(".tmp");
}

void sync_folder(const std::filesystem::path& folder) {
  const std::filesystem::path name = folder.empty() ? "." : folder;
  const UniqueFd fd = open_file(name, O_RDONLY | O_DIRECTORY);
  // Some file systems know no fsync of a folder; their renames are as durable as they get.
  if (::fsync(fd.get()) != 0 && errno != EINVAL && errno != ENOSYS) throw system_error(name, "cannot sync", errno);
}

void rename_into_place(const std::filesystem::path& temporary, const std::filesystem::path& path) {
  if (::rename(temporary.c_str(), path.c_str()) != 0) {
    const int error_number = errno;
    ::unlink(temporary.c_str());
    throw system_error(path, "cannot write", error_number);
  }
  sync_folder(path.parent_path());
}

void copy_whole_file(const std::filesystem::path& from, const std::filesystem::path& to) {
  const std::filesystem::path temporary = temporary_name(to);
  std::filesystem::copy_file(from, temporary, std::filesystem::copy_options::overwrite_existing);
  {
    const UniqueFd fd = open_file(temporary, O_RDONLY);
    if (::fsync(fd.get()) != 0) throw system_error(to, "cannot write", errno);
  }
  rename_into_place(temporary, to);
}

void write_whole_file(const std::filesystem::path& path, std::string_view text) {
  const std::filesystem::path temporary = temporary_name(path);
  UniqueFd fd(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (fd.get() < 0) throw system_error(path, "cannot write", errno);
  int error_number = write_all(fd.get(), text);
  if (error_number == 0 && ::fsync(fd.get()) != 0) error_number = errno;
  if (::close(fd.release()) != 0 && error_number == 0) error_number = errno;
  if (error_number != 0) {
    ::unlink(temporary.c_str());
    throw system_error(path, "cannot write", error_number);
  }
  rename_into_place(temporary, path);
}

std::string read_whole_file(const std::filesystem::path& path) {
  const UniqueFd fd = open_file(path, O_RDONLY);
  std::string text;
  char buffer[1 << 16];
  for (;;) {
    const ssize_t n = ::read(fd.get(), buffer, sizeof buffer);
    if (n == 0) return text;
    if (n > 0) text.append(buffer, static_cast<std::size_t>(n));
    else if (errno != EINTR) throw system_error(path, "cannot read", errno);
  }
}

AppendFile::AppendFile(std::filesystem::path path, UniqueFd fd, std::size_t size)
    : path_(std::move(path)), fd_(std::move(fd)), size_(size) {}

AppendFile AppendFile::create(const std::filesystem::path& path) {
  return AppendFile(path, open_file(path, O_WRONLY | O_CREAT | O_TRUNC | O_APPEND), 0);
}

AppendFile AppendFile::reopen(const std::filesystem::path& path, std::size_t size) {
  AppendFile file(path, open_file(path, O_WRONLY | O_CREAT | O_APPEND), size);
  struct stat status {};
  if (::fstat(file.fd_.get(), &status) != 0) throw system_error(path, "cannot open", errno);
  if (static_cast<std::size_t>(status.st_size) < size)
    throw OutputError(path.string() + ": became shorter while it was opened");
  if (::ftruncate(file.fd_.get(), static_cast<off_t>(size)) != 0) throw system_error(path, "cannot shorten", errno);
  return file;
}

void AppendFile::append(std::string_view line) {
  const int error_number = write_all(fd_.get(), line);
  if (error_number != 0) {
    // Should taking back fail too, the torn last line is dropped by the reader.
    if (::ftruncate(fd_.get(), static_cast<off_t>(size_)) != 0) errno = 0;
    throw system_error(path_, "cannot write", error_number);
  }
  size_ += line.size();
}

void AppendFile::sync() {
  if (::fdatasync(fd_.get()) != 0) throw system_error(path_, "cannot sync", errno);
}

}  // namespace platen
