#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "client/inspect/mesh_inspection.h"

namespace isomatch {

/// A mesh and all that `isomatch inspect` says about it.
struct InspectionReport {
  std::string path;
  /// "OFF", "PLY" and so on.
  std::string format;
  MeshInspection mesh;
  MatchCost cost;
  /// Warnings from reading the file.
  std::vector<std::string> reading;
};

/// Lines for people.
std::string FormatInspection(const InspectionReport& report);

/// client/README.md lists the fields.
nlohmann::ordered_json InspectionJson(const InspectionReport& report);

}  // namespace isomatch
