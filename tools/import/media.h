#pragma once

// Participating media by name: MakeNamedMedium and MediumInterface.

#include <map>
#include <string>

#include "tools/import/params.h"
#include "tools/import/session.h"
#include "tools/import/transform.h"

namespace spillway::tools {

// Which media lie on both sides of what follows. Empty names: nothing.
struct MediumNames {
  Token inside, outside;
  [[nodiscard]] bool divide() const { return inside.text != outside.text; }
};

class MediumTable {
 public:
  explicit MediumTable(Session& session) : session_(session) {}

  // Sends the medium to the sink. world_from_medium: the current transform.
  Status define(const Token& name, ParamList params, const Transform& world_from_medium);
  // The sink's number, or kNoMedium for an empty name.
  Result<uint32_t> find(const Token& name) const;

 private:
  Session& session_;
  std::map<std::string, uint32_t> media_;
  bool has_black_bodies_ = false;
};

// The names after MediumInterface: one is inside and outside.
Result<MediumNames> read_medium_interface(Tokenizer& tokens, const Token& directive);

}  // namespace spillway::tools
