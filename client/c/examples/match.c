/* Matches two mesh files in this process: match X Y, and prints for each vertex
 * of X its vertex of Y.
 *
 *   cc -std=c99 match.c -lisomatch -o match */
#include <inttypes.h>
#include <isomatch.h>
#include <stdio.h>

static int show(void* user, const char* stage, double stage_fraction,
                double total_fraction) {
  (void)user;
  (void)stage_fraction;
  fprintf(stderr, "\r%3.0f %% %-20s", 100 * total_fraction, stage);
  return 0; /* go on */
}

/* Says what went wrong, if anything did; returns whether nothing did. */
static int is_ok(isomatch_status status, isomatch_error** error) {
  if (status == ISOMATCH_OK) return 1;
  fprintf(stderr, "\n%s\n", isomatch_error_message(*error));
  isomatch_error_free(*error);
  return 0;
}

static void print_map(const isomatch_result* result) {
  const int32_t* map = isomatch_result_map(result);
  for (int64_t i = 0; i < isomatch_result_num_vertices(result); ++i) {
    printf("%" PRId32 "\n", map[i]);
  }
  fprintf(stderr, "\n%s: %s\n", isomatch_result_verdict(result),
          isomatch_result_verdict_reason(result));
}

int main(int argc, char** argv) {
  isomatch_mesh_file* x = NULL;
  isomatch_mesh_file* y = NULL;
  isomatch_result* result = NULL;
  isomatch_error* error = NULL;
  if (argc != 3) {
    fprintf(stderr, "usage: %s X Y\n", argv[0]);
    return 2;
  }
  if (is_ok(isomatch_mesh_file_read(argv[1], &x, &error), &error) &&
      is_ok(isomatch_mesh_file_read(argv[2], &y, &error), &error)) {
    /* Arrays of one's own do as well: an isomatch_mesh only points to them. */
    const isomatch_pair pair = {.mesh_x = isomatch_mesh_file_mesh(x),
                                .mesh_y = isomatch_mesh_file_mesh(y)};
    const isomatch_control control = {.progress = show};
    if (is_ok(isomatch_match(&pair, NULL, &control, &result, &error), &error)) {
      print_map(result);
    }
  }
  const int exit_status = result == NULL;
  isomatch_result_free(result);
  isomatch_mesh_file_free(x);
  isomatch_mesh_file_free(y);
  return exit_status;
}
