// Files that are either whole or not there, and files that only grow by whole lines.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "protocol/output/output_error.h"

namespace platen {

// Owns a file descriptor.
class UniqueFd {
 public:
  explicit UniqueFd(int fd = -1) noexcept : fd_(fd) {}
  UniqueFd(UniqueFd&& other) noexcept : fd_(other.release()) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept;
  ~UniqueFd();
  int get() const noexcept { return fd_; }
  int release() noexcept;

 private:
  int fd_;
};

// `path: what: strerror(error_number)`
OutputError system_error(const std::filesystem::path& path, const std::string& what, int error_number);

// Where the text of `path` stands until it is complete: the same folder, so that the rename is atomic.
std::filesystem::path temporary_name(const std::filesystem::path& path);

// Flushes to disk the names that a folder holds. Throws OutputError.
void sync_folder(const std::filesystem::path& folder);

// Gives a finished, already synced temporary file its final name, and makes the name durable. Throws OutputError; the
// temporary file is removed then.
void rename_into_place(const std::filesystem::path& temporary, const std::filesystem::path& path);

// Writes a whole file: temporary name, fsync, rename, fsync of the folder. At any moment `path` is absent, the old file
// or the new one. Throws OutputError; the old file stays then.
void write_whole_file(const std::filesystem::path& path, std::string_view text);

// A copy of a file, on disk before it returns. Throws OutputError, std::filesystem::filesystem_error.
void copy_whole_file(const std::filesystem::path& from, const std::filesystem::path& to);

// The whole contents of a file. Throws OutputError.
std::string read_whole_file(const std::filesystem::path& path);

// A log of lines. A line that could not be written whole is taken back, so a full disk leaves whole lines only.
class AppendFile {
 public:
  static AppendFile create(const std::filesystem::path& path);  // new and empty
  // Goes on after the first `size` bytes; what lies beyond is cut off.
  static AppendFile reopen(const std::filesystem::path& path, std::size_t size);

  void append(std::string_view line);  // handed to the system before it returns: survives kill -9
  void sync();                         // on disk before it returns: survives a power cut

 private:
  AppendFile(std::filesystem::path path, UniqueFd fd, std::size_t size);
  std::filesystem::path path_;
  UniqueFd fd_;
  std::size_t size_;
};

}  // namespace platen
