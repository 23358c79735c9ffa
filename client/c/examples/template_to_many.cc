// One template against many meshes, in this process: template_to_many TEMPLATE
// MESH..., and prints the verdict on each. The template is prepared once.
//
//   c++ -std=c++17 template_to_many.cc -lisomatch -o template_to_many
#include <isomatch.h>

#include <iostream>
#include <memory>
#include <stdexcept>

// What the library returns, given back to it.
template <auto free>
struct Free {
  template <typename Object>
  void operator()(Object* object) const {
    free(object);
  }
};
using MeshFile =
    std::unique_ptr<isomatch_mesh_file, Free<isomatch_mesh_file_free>>;
using Shape = std::unique_ptr<isomatch_shape, Free<isomatch_shape_free>>;
using Result = std::unique_ptr<isomatch_result, Free<isomatch_result_free>>;
using Error = std::unique_ptr<isomatch_error, Free<isomatch_error_free>>;

void Check(isomatch_status status, isomatch_error** error) {
  const Error owned(*error);
  if (status != ISOMATCH_OK) {
    throw std::runtime_error(isomatch_error_message(owned.get()));
  }
}

MeshFile Read(const char* path) {
  isomatch_mesh_file* file = nullptr;
  isomatch_error* error = nullptr;
  Check(isomatch_mesh_file_read(path, &file, &error), &error);
  return MeshFile(file);
}

Shape Prepare(const isomatch_mesh* mesh) {
  isomatch_shape* shape = nullptr;
  isomatch_error* error = nullptr;
  Check(isomatch_prepare(mesh, nullptr, nullptr, &shape, &error), &error);
  return Shape(shape);
}

Result Match(const isomatch_shape* shape, const isomatch_mesh* mesh) {
  isomatch_pair pair = {};
  pair.shape_x = shape;
  pair.mesh_y = mesh;
  isomatch_result* result = nullptr;
  isomatch_error* error = nullptr;
  Check(isomatch_match(&pair, nullptr, nullptr, &result, &error), &error);
  return Result(result);
}

int main(int argc, char** argv) {
  if (argc < 3) {
    std::cerr << "usage: " << argv[0] << " TEMPLATE MESH...\n";
    return 2;
  }
  try {
    const MeshFile file = Read(argv[1]);
    const Shape shape = Prepare(isomatch_mesh_file_mesh(file.get()));
    for (int i = 2; i < argc; ++i) {
      const MeshFile other = Read(argv[i]);
      const Result result =
          Match(shape.get(), isomatch_mesh_file_mesh(other.get()));
      std::cout << argv[i] << ": " << isomatch_result_verdict(result.get())
                << ", first vertex goes to "
                << isomatch_result_map(result.get())[0] << "\n";
    }
  } catch (const std::runtime_error& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
}
