/* Matches two .off files in this process: match X.off Y.off, and prints for
 * each vertex of X its vertex of Y.
 *
 *   cc -std=c99 match.c -lisomatch -o match */
#include <inttypes.h>
#include <isomatch.h>
#include <stdio.h>
#include <stdlib.h>

/* Reads triangles only; returns 0 on failure. */
static int read_off(const char* path, isomatch_mesh* mesh) {
  FILE* file = fopen(path, "r");
  double* positions = NULL;
  int32_t* faces = NULL;
  int is_read = 0;
  if (file != NULL && fscanf(file, "OFF %" SCNd64 " %" SCNd64 " %*d",
                             &mesh->num_vertices, &mesh->num_faces) == 2) {
    positions = malloc(sizeof(double) * 3 * (size_t)mesh->num_vertices);
    faces = malloc(sizeof(int32_t) * 3 * (size_t)mesh->num_faces);
    is_read = positions != NULL && faces != NULL;
    for (int64_t i = 0; is_read && i < 3 * mesh->num_vertices; ++i) {
      is_read = fscanf(file, "%lf", &positions[i]) == 1;
    }
    for (int64_t i = 0; is_read && i < mesh->num_faces; ++i) {
      int32_t* face = faces + 3 * i;
      is_read = fscanf(file, " 3 %" SCNd32 " %" SCNd32 " %" SCNd32, &face[0],
                       &face[1], &face[2]) == 3;
    }
  }
  if (file != NULL) fclose(file);
  mesh->positions = positions;
  mesh->faces = faces;
  if (!is_read)
    fprintf(stderr, "%s: expected an OFF file of triangles\n", path);
  return is_read;
}

static int show(void* user, const char* stage, double stage_fraction,
                double total_fraction) {
  (void)user;
  (void)stage_fraction;
  fprintf(stderr, "\r%3.0f %% %-20s", 100 * total_fraction, stage);
  return 0; /* go on */
}

static void free_mesh(const isomatch_mesh* mesh) {
  free((void*)mesh->positions);
  free((void*)mesh->faces);
}

int main(int argc, char** argv) {
  isomatch_mesh x = {0};
  isomatch_mesh y = {0};
  int exit_status = 1;
  if (argc != 3) {
    fprintf(stderr, "usage: %s X.off Y.off\n", argv[0]);
    return 2;
  }
  if (read_off(argv[1], &x) && read_off(argv[2], &y)) {
    const isomatch_pair pair = {.mesh_x = &x, .mesh_y = &y};
    const isomatch_control control = {.progress = show};
    isomatch_result* result = NULL;
    isomatch_error* error = NULL;
    if (isomatch_match(&pair, NULL, &control, &result, &error) == ISOMATCH_OK) {
      const int32_t* map = isomatch_result_map(result);
      for (int64_t i = 0; i < isomatch_result_num_vertices(result); ++i) {
        printf("%" PRId32 "\n", map[i]);
      }
      fprintf(stderr, "\n%s: %s\n", isomatch_result_verdict(result),
              isomatch_result_verdict_reason(result));
      exit_status = 0;
    } else {
      fprintf(stderr, "\n%s\n", isomatch_error_message(error));
    }
    isomatch_error_free(error);
    isomatch_result_free(result);
  }
  free_mesh(&x);
  free_mesh(&y);
  return exit_status;
}
