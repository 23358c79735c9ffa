#pragma once

#include <atomic>
#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "client/c/isomatch.h"
#include "core/mesh/mesh_size.h"
#include "core/mesh/triangle_mesh.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_shape.h"

// What the handles of isomatch.h are.

struct isomatch_error {
  isomatch_status status;
  std::string message;
  std::string field;
};

struct isomatch_options {
  isomatch::MatchOptions options;
  std::int64_t deadline_milliseconds = 0;  ///< 0 for none
};

struct isomatch_cancel {
  std::stop_source stop;
  mutable std::atomic<bool> has_map = false;  ///< of the call that it watches
};

struct isomatch_shape {
  isomatch::PreparedShape shape;
  isomatch::MeshSize size;
};

/// A mesh of a file, and what C sees of it.
struct isomatch_mesh_file {
  isomatch::TriangleMesh read;
  isomatch_mesh mesh;
  std::vector<std::string> warnings;
};

struct isomatch_text {
  std::string text;
};

/// What the core found, with the arrays that C has in another form.
struct isomatch_result {
  isomatch::Correspondence found;
  std::vector<std::int32_t> precise_vertices;
  std::vector<double> precise_weights;
  std::vector<double> functional_map;
  std::vector<std::string> warnings;
  std::string report;
};
