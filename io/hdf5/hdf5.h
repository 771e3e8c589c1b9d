// Numbers out of HDF5 files, as h5py, libhdf5 and MATLAB (v7.3) write them: what is needed of the format, and no more.
// Own code, because libhdf5 as Debian builds it brings 31 more libraries (curl, Kerberos, LDAP ...), which adds 7 ms to
// every start of the program; it is not made for several threads, nor for files of strangers.
#pragma once

#include "io/file_bytes.h"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

/// How a data set's numbers lie in the file.
struct Hdf5Number {
    bool floats = false, is_signed = false, big_endian = false;
    std::size_t bytes = 0; ///< floats: 2, 4 or 8; integers: 1, 2, 4 or 8

    [[nodiscard]] double at(const char* element) const;
};

/// A data set's numbers where they are packed together: `stored` bytes at `address`.
struct Hdf5Chunk {
    std::uint64_t address = 0, stored = 0;
    std::uint32_t left_out = 0; ///< filters that were not applied, a bit each
};

enum class Hdf5Filter : std::uint16_t { deflate = 1, shuffle = 2, fletcher32 = 3 };

/// An array of numbers. Several threads may read at once.
class Hdf5Dataset {
  public:
    /// "file: name", for messages.
    [[nodiscard]] const std::string& name() const { return name_; }
    [[nodiscard]] const std::vector<std::uint64_t>& shape() const { return shape_; } ///< outermost first
    [[nodiscard]] const Hdf5Number& number() const { return number_; }
    /// "float16 of 768x1024"
    [[nodiscard]] std::string described() const;

    /// The elements, as they lie in the file, of `count` slices of the outermost dimension.
    /// Throws Error naming file, data set and place for damage, OutOfMemory where they do not fit.
    [[nodiscard]] std::string elements(std::uint64_t first, std::uint64_t count) const;
    /// All numbers. Throws Error, too, where there are more than `most`.
    [[nodiscard]] std::vector<double> numbers(std::uint64_t most) const;

  private:
    friend class Hdf5File;
    Hdf5Dataset() = default;
    [[nodiscard]] std::string chunk(const Hdf5Chunk& chunk) const;

    std::shared_ptr<const FileBytes> file_;
    std::string name_;
    std::vector<std::uint64_t> shape_;
    Hdf5Number number_;
    std::string compact_;                   ///< the elements themselves, where they lie in the description
    std::uint64_t address_ = 0;             ///< of the elements, where they lie together
    std::vector<std::uint64_t> chunk_size_; ///< else in chunks: their extent
    std::vector<Hdf5Chunk> chunks_;         ///< in rows, as elements are
    std::vector<Hdf5Filter> filters_;       ///< in the order of their application
    std::uint64_t chunk_bytes_ = 0;
};

/// The data sets at the top of a file. Source: The HDF Group's "HDF5 File Format Specification", version 3.0.
class Hdf5File {
  public:
    /// Throws Error naming the file for damage, and for what of the format is not read.
    explicit Hdf5File(const std::filesystem::path& path);

    [[nodiscard]] const std::vector<std::string>& names() const { return names_; } ///< of data sets and groups
    [[nodiscard]] bool has(const std::string& name) const;
    /// Throws Error where there is none of that name, listing those that are.
    [[nodiscard]] Hdf5Dataset dataset(const std::string& name) const;

  private:
    std::shared_ptr<const FileBytes> file_;
    std::uint64_t base_ = 0; ///< what addresses are counted from
    std::vector<std::string> names_;
    std::vector<std::uint64_t> headers_; ///< of each name
};

/// Whether a file with these first bytes is HDF5; MATLAB puts 512 bytes of its own before.
[[nodiscard]] bool is_hdf5(std::string_view start);

} // namespace scanshade
