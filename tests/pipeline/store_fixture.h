#pragma once

// Small stores whose manifest is damaged, number by number.

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "pipeline/store.h"
#include "tests/pipeline/pack_scene.h"

namespace spillway::pipeline::test {

// Two quads, a lamp, an instance that moves and a camera that does: a manifest of some thousand bytes, so that each can
// be tried. lit: the prototype emits too and stands still, so that the store has light trees.
Status pack_small(const std::filesystem::path& path, std::vector<std::filesystem::path> sources = {}, bool lit = false);
// A fog that the camera is in, and a fire of two grids in a box of it.
Status pack_gas(const std::filesystem::path& path);
// Follows everything a renderer follows in the tables; under the sanitizers this is the test.
void use(const Store& store);

class StoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const Status packed = pack_small(store_);
    ASSERT_TRUE(packed) << packed.error().message;
    manifest_ = file_bytes(store_ / kManifestFile);
  }
  // Another store in the place of the first.
  void pack_lit() { replace(pack_small(store_, {}, true)); }
  void replace(const Status& packed) {
    ASSERT_TRUE(packed) << packed.error().message;
    manifest_ = file_bytes(store_ / kManifestFile);
  }
  void write_manifest(const std::string& bytes) {
    std::ofstream file(store_ / kManifestFile, std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  // The start of section `name` in the manifest, and its entry.
  size_t section_offset(const std::string& name, size_t& entry);
  // Changes the manifest at a place of a section, with checksums put right again.
  void damage(const std::string& section, size_t byte, std::byte flip);
  template <class T>
  void set(const std::string& section, size_t byte, T value);
  void set_checksums(std::string& bytes, size_t entry);
  struct Counts {
    size_t tried = 0, refused = 0;
  };
  Counts flip_all(const std::vector<std::string>& sections);
  // One number put somewhere else: each must be refused, with the manifest named.
  struct Damage {
    const char* section;
    size_t byte;
    uint32_t value;
  };
  void expect_refused(std::span<const Damage> cases);

  TemporaryDirectory directory_;
  std::filesystem::path store_ = directory_ / "a.store";
  std::string manifest_;
};

template <class T>
void StoreTest::set(const std::string& section, size_t byte, T value) {
  size_t entry = 0;
  std::string bytes = manifest_;
  std::memcpy(bytes.data() + section_offset(section, entry) + byte, &value, sizeof value);
  set_checksums(bytes, entry);
  write_manifest(bytes);
}

}  // namespace spillway::pipeline::test
