#include "tests/support/draco_stream.h"

namespace isomatch {

std::string DracoHeader(char method, char geometry, char major, char minor) {
  return std::string("DRACO") + major + minor + geometry + method +
         std::string(2, '\0');
}

std::string DracoVarint(std::uint32_t value) {
  std::string bytes;
  for (; value >= 128; value >>= 7) {
    bytes += static_cast<char>((value & 127) | 128);
  }
  return bytes + static_cast<char>(value);
}

std::string Padded(std::string bytes, std::size_t size) {
  bytes.resize(size, '\x55');
  return bytes;
}

std::string EdgebreakerClaim(std::uint32_t vertices, std::uint32_t faces,
                             char connectivities, std::size_t size) {
  return Padded(DracoHeader(kDracoEdgebreaker) + '\0' + DracoVarint(vertices) +
                    DracoVarint(faces) + connectivities + DracoVarint(faces) +
                    DracoVarint(0),
                size);
}

std::string DracoAttribute(char type, char data_type, char components) {
  return std::string("\1\1") + type + data_type + components +
         std::string(3, '\0');
}

std::string DracoTriangle(const std::string& indices, const std::string& rest) {
  return DracoHeader(kDracoSequential) + DracoVarint(1) + DracoVarint(3) +
         '\1' + indices + rest;
}

}  // namespace isomatch
