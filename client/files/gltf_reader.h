#pragma once

#include <optional>
#include <string>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Reads the triangles of a glTF 2 file, binary (.glb) or text (.gltf):
///
/// 1. The nodes of the default scene, else the first one, else all nodes, are
///    gone over depth first, children in order; each places the primitives of
///    its mesh with its transform. Vertices are those of the POSITION
///    accessors in this order; primitives of one node that share it share them.
///    Without any node the meshes stand as they are. Where a transform mirrors,
///    faces are turned over.
/// 2. Triangles, strips and fans; points and lines are left out, with a
///    warning, as are skins and morph targets: the mesh is as at rest.
/// 3. Colors are COLOR_0, made sRGB of linear. Texture coordinates are those of
///    the material's base color, with v from below as OBJ has it. Images are
///    not decoded: `texture.images` has their bytes, or the file's path.
///
/// A text file may name others in `folder` or below it, which symbolic links
/// do not leave; "" for none. Returns the first fault: what OpenGltf finds, an
/// accessor that does not fit its buffer, that is sparse or of another type, an
/// index that no vertex has, a node with two parents, meshes that are placed so
/// often that they take much more than the file. Time and memory are
/// proportional to the files' size.
std::optional<MeshFault> ReadGltfSoup(absl::string_view bytes,
                                      const std::string& folder,
                                      PolygonSoup* soup);

}  // namespace isomatch
