#pragma once

#include <fstream>  // which the header needs and does not include

// tinygltf, compiled into gltf_loader.cc under a name of its own: without
// images, files and symbols that programs which link ours might have, too.
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_FS
#define tinygltf isomatch_tinygltf
#include <tiny_gltf.h>
#undef tinygltf
