/* Isomatch in the caller's process: dense correspondences between
 * near-isometric triangle meshes (Holzschuh, Laehner, Cremers: Simulated
 * Annealing for 3D Shape Correspondence, 3DV 2020). C99.
 *
 *   isomatch_pair pair = {.mesh_x = &x, .mesh_y = &y};
 *   isomatch_result* result = NULL;
 *   isomatch_error* error = NULL;
 *   if (isomatch_match(&pair, NULL, NULL, &result, &error) != ISOMATCH_OK) {
 *     fprintf(stderr, "%s\n", isomatch_error_message(error));
 *     isomatch_error_free(error);
 *     return 1;
 *   }
 *   const int32_t* y_from_x = isomatch_result_map(result);
 *   ...
 *   isomatch_result_free(result);
 *
 * What functions return is the caller's, who gives it back to the free function
 * of its type; those take NULL. Texts and arrays belong to the object that was
 * asked and live as long. Texts are UTF-8.
 *
 * Functions may be called by any number of threads at the same time. An object
 * may be used by several at a time that do not change it: only the set
 * functions of options and the free functions change one. Nothing throws,
 * writes to standard output or error, or keeps anything between calls.
 *
 * The library's ABI, libisomatch.so.0, only grows. */
#ifndef ISOMATCH_H_
#define ISOMATCH_H_

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define ISOMATCH_API __attribute__((visibility("default")))
#else
#define ISOMATCH_API
#endif

/* How a call ended. */
typedef enum isomatch_status {
  ISOMATCH_OK = 0,
  /* A mesh, landmark or option is wrong; the error names field, value and what
   * was expected. */
  ISOMATCH_INVALID_ARGUMENT = 1,
  /* By isomatch_cancel_request, or by the progress function. */
  ISOMATCH_CANCELLED = 2,
  /* A mesh cannot be decimated and needs more than memory_limit_bytes, or the
   * process has no memory left. */
  ISOMATCH_OUT_OF_MEMORY = 3,
  /* A numerical step failed. */
  ISOMATCH_INTERNAL = 4
} isomatch_status;

/* The release, as "0.1.0". */
ISOMATCH_API const char* isomatch_version(void);

/* Why a call failed. */
typedef struct isomatch_error isomatch_error;

ISOMATCH_API isomatch_status isomatch_error_status(const isomatch_error* error);
/* A sentence. */
ISOMATCH_API const char* isomatch_error_message(const isomatch_error* error);
/* The argument at fault, as "mesh_x", "landmarks[3].y" or "options.threads"; ""
 * for none. */
ISOMATCH_API const char* isomatch_error_field(const isomatch_error* error);
ISOMATCH_API void isomatch_error_free(isomatch_error* error);

/* A triangle mesh that stays the caller's: nothing of it is kept after a call.
 * It is taken in single precision from the middle of its box on, and in another
 * order of its faces, as a server would get it, whose maps are the same. Its
 * layout never changes. */
typedef struct isomatch_mesh {
  /* num_vertices times x, y, z, in any unit. */
  const double* positions;
  int64_t num_vertices;
  /* num_faces times three vertices, 0-based, counter-clockwise seen from
   * outside. */
  const int32_t* faces;
  int64_t num_faces;
} isomatch_mesh;

/* A known match: vertex x of X corresponds to vertex y of Y. */
typedef struct isomatch_landmark {
  int32_t x;
  int32_t y;
} isomatch_landmark;

/* Options by name; wherever they are taken NULL is the default of all:
 *
 * - "profile": "default", or "paper": as published
 * - "relation": "whole": all of both shapes corresponds, or, with the default
 *   profile, "part-of-y": X is a part of Y, "part-of-x": Y is a part of X,
 *   "overlap": each lacks something that the other has; needs scale "same",
 *   "auto": one of these, to be found out; the report says which
 * - "scale": "auto", or "same": X and Y have one unit, not with "whole"
 * - "random_seed": 1; 0 or more
 * - "threads": 0: one for each core; the result does not depend on it
 * - "memory_limit_bytes": 0: no limit; beyond the two meshes
 * - "solved_vertices": 4000: larger meshes are decimated to about as many, and
 *   the map lifted to all vertices; 0: never
 * - "deadline_milliseconds": 0: none; of isomatch_match with the default
 *   profile: then the best map there is becomes the result, the first whole one
 *   at least, as figure "ended_early" says; more time gives a better one on
 *   average, and which one it is depends on how fast the machine is
 * - "match_components": 1: large components are matched one by one; or 0
 * - "landmarks_exact": 0; 1: landmarks are kept even if the rest contradicts
 *   them
 * - "keep_functional_map": 0; 1: see isomatch_result_functional_map */
typedef struct isomatch_options isomatch_options;

/* Returns the defaults; NULL without memory. */
ISOMATCH_API isomatch_options* isomatch_options_new(void);
/* ISOMATCH_INVALID_ARGUMENT: there is no such option, or not with this value;
 * it stays as it was then. `error` may be NULL, here and everywhere. */
ISOMATCH_API isomatch_status
isomatch_options_set_integer(isomatch_options* options, const char* name,
                             int64_t value, isomatch_error** error);
ISOMATCH_API isomatch_status
isomatch_options_set_text(isomatch_options* options, const char* name,
                          const char* value, isomatch_error** error);
ISOMATCH_API void isomatch_options_free(isomatch_options* options);

/* Ends calls of other threads. */
typedef struct isomatch_cancel isomatch_cancel;

/* NULL without memory. */
ISOMATCH_API isomatch_cancel* isomatch_cancel_new(void);
/* Calls that it was given to, and those it will be given to, end with
 * ISOMATCH_CANCELLED: within a quarter of a second, but for the first steps of
 * meshes of a million vertices. For any thread, but for no signal handler. */
ISOMATCH_API void isomatch_cancel_request(isomatch_cancel* cancel);
/* 1 once the call that it was given to last has a whole map, which
 * "deadline_milliseconds" would end with, else 0. For any thread, during the
 * call as well. */
ISOMATCH_API int isomatch_cancel_has_map(const isomatch_cancel* cancel);
ISOMATCH_API void isomatch_cancel_free(isomatch_cancel* cancel);

/* How a call is followed, and ended. NULL where it is taken is neither. */
typedef struct isomatch_control {
  /* Called by one thread at a time, not always the caller's, with a stage as
   * "first insertion", how far that is, and how far all is, 0 to 1, which never
   * falls. Has to be quick. Anything but 0 cancels. May be NULL. */
  int (*progress)(void* user, const char* stage, double stage_fraction,
                  double total_fraction);
  void* user;
  /* May be NULL. Outlives the call. */
  const isomatch_cancel* cancel;
} isomatch_control;

/* How large two meshes are. Its layout never changes. */
typedef struct isomatch_sizes {
  int64_t vertices_x;
  int64_t faces_x;
  int64_t vertices_y;
  int64_t faces_y;
} isomatch_sizes;

/* An upper bound on the memory that isomatch_match takes for such meshes,
 * beyond the two. */
ISOMATCH_API isomatch_status isomatch_estimate_bytes(
    const isomatch_sizes* sizes, const isomatch_options* options,
    int64_t* bytes, isomatch_error** error);

/* A mesh and what matching needs to know of it alone: whoever matches one mesh
 * with many prepares it once. */
typedef struct isomatch_shape isomatch_shape;

ISOMATCH_API isomatch_status isomatch_prepare(const isomatch_mesh* mesh,
                                              const isomatch_options* options,
                                              const isomatch_control* control,
                                              isomatch_shape** shape,
                                              isomatch_error** error);
ISOMATCH_API void isomatch_shape_free(isomatch_shape* shape);

/* What is matched: of each side a mesh, or a shape that was prepared with the
 * same options, but for random_seed, threads, landmarks_exact,
 * keep_functional_map, relation and scale. Its layout never changes. */
typedef struct isomatch_pair {
  const isomatch_mesh* mesh_x;
  const isomatch_shape* shape_x;
  const isomatch_mesh* mesh_y;
  const isomatch_shape* shape_y;
  /* num_landmarks of them; no vertex comes twice. */
  const isomatch_landmark* landmarks;
  int64_t num_landmarks;
} isomatch_pair;

/* What was found. */
typedef struct isomatch_result isomatch_result;

/* Finds for every vertex of X its place on Y. The result depends on meshes,
 * landmarks and options only: the same bytes at any number of threads, and of
 * shapes as of meshes. */
ISOMATCH_API isomatch_status isomatch_match(const isomatch_pair* pair,
                                            const isomatch_options* options,
                                            const isomatch_control* control,
                                            isomatch_result** result,
                                            isomatch_error** error);

ISOMATCH_API void isomatch_result_free(isomatch_result* result);

/* Vertices of X: what the following arrays have entries for, unless said. */
ISOMATCH_API int64_t
isomatch_result_num_vertices(const isomatch_result* result);
/* The vertex of Y of each; -1 for one without a counterpart: on no face or,
 * with "part-of-x" and "overlap", on what Y lacks. */
ISOMATCH_API const int32_t* isomatch_result_map(const isomatch_result* result);
/* How far to trust each, 0 to 1. */
ISOMATCH_API const float* isomatch_result_confidence(
    const isomatch_result* result);
/* Vertices of Y, and for each whether X has a counterpart: 1, or 0. Between
 * whole shapes each on a face has one. */
ISOMATCH_API int64_t
isomatch_result_num_vertices_y(const isomatch_result* result);
ISOMATCH_API const uint8_t* isomatch_result_mask_y(
    const isomatch_result* result);
/* As the map, between the vertices of Y: three vertices of a face each, and
 * their barycentric weights; -1 and 0 for no place. */
ISOMATCH_API const int32_t* isomatch_result_precise_vertices(
    const isomatch_result* result);
ISOMATCH_API const double* isomatch_result_precise_weights(
    const isomatch_result* result);

/* Maps that were not chosen, best first: symmetric images, as a rule. */
ISOMATCH_API int64_t
isomatch_result_num_alternatives(const isomatch_result* result);
/* NULL when there is no such one. */
ISOMATCH_API const int32_t* isomatch_result_alternative(
    const isomatch_result* result, int64_t index);

/* What the map is worth: "good", "doubtful" or "bad"; why; what to do ("" for a
 * good one). */
ISOMATCH_API const char* isomatch_result_verdict(const isomatch_result* result);
ISOMATCH_API const char* isomatch_result_verdict_reason(
    const isomatch_result* result);
ISOMATCH_API const char* isomatch_result_verdict_advice(
    const isomatch_result* result);

/* A figure by name; NaN when there is no such one:
 *
 * - "symmetry_confidence": 0 to 1: how clearly the map beats the others
 * - "mean_confidence": 0 to 1
 * - "coverage": fraction of Y's area that is reached
 * - "geodesic_distortion": mean, fraction of sqrt(area); 0 for an isometry
 * - "area_distortion": mean |ln(area of an image / area)|
 * - "orientation_score": -1 (mirrored) to 1 (orientation kept)
 * - "embedding_error", "objective": Eq. 8 and 4 of the paper
 * - "relation_confidence": 0 to 1, how sure the relation is
 * - "scale": X's lengths times this are in Y's unit
 * - "ended_early": 1 where "deadline_milliseconds" ended it, else 0
 * - "area_x", "area_y": squared mesh units */
ISOMATCH_API double isomatch_result_figure(const isomatch_result* result,
                                           const char* name);

/* What was found and mended in the meshes, and what else the user should know.
 */
ISOMATCH_API int64_t
isomatch_result_num_warnings(const isomatch_result* result);
/* NULL when there is no such one. */
ISOMATCH_API const char* isomatch_result_warning(const isomatch_result* result,
                                                 int64_t index);

/* Whether the landmark was kept: 1; 0: the rest of the map contradicts it; -1:
 * there is no such one. */
ISOMATCH_API int isomatch_result_landmark_kept(const isomatch_result* result,
                                               int64_t index);

/* All that is known of the result, as JSON: the fields of REPORT.json in
 * client/README.md without times and memory, for what can read that. */
ISOMATCH_API const char* isomatch_result_report(const isomatch_result* result);

/* With "keep_functional_map": the number k of eigenfunctions, else 0; the k x k
 * matrix, by rows, that carries those of Y (columns) to X (rows); k
 * eigenvalues, 1 / area. */
ISOMATCH_API int64_t
isomatch_result_functional_map_size(const isomatch_result* result);
ISOMATCH_API const double* isomatch_result_functional_map(
    const isomatch_result* result);
ISOMATCH_API const double* isomatch_result_eigenvalues_x(
    const isomatch_result* result);
ISOMATCH_API const double* isomatch_result_eigenvalues_y(
    const isomatch_result* result);

/* A mesh file in memory. */
typedef struct isomatch_mesh_file isomatch_mesh_file;

/* Reads OFF, OBJ, PLY, STL, glTF, GLB, VTK or Draco, known by its extension,
 * packed by gzip or not; "-" is standard input. Vertices keep the file's number
 * and order, those of Draco the numbers of its vertex_id attribute, if it has
 * one; equal corners of an STL are joined. Quadrilaterals are cut along their
 * shorter diagonal, larger polygons into a fan. An error's field is "path", and
 * its message names the line. */
ISOMATCH_API isomatch_status isomatch_mesh_file_read(const char* path,
                                                     isomatch_mesh_file** file,
                                                     isomatch_error** error);
ISOMATCH_API void isomatch_mesh_file_free(isomatch_mesh_file* file);
/* Lives as long as the file. */
ISOMATCH_API const isomatch_mesh* isomatch_mesh_file_mesh(
    const isomatch_mesh_file* file);
ISOMATCH_API int64_t
isomatch_mesh_file_num_warnings(const isomatch_mesh_file* file);
/* NULL when there is no such one. */
ISOMATCH_API const char* isomatch_mesh_file_warning(
    const isomatch_mesh_file* file, int64_t index);

/* A text of any length. */
typedef struct isomatch_text isomatch_text;

/* Ends with a 0, which is not part of it. */
ISOMATCH_API const char* isomatch_text_data(const isomatch_text* text);
/* Bytes, of UTF-8. */
ISOMATCH_API int64_t isomatch_text_size(const isomatch_text* text);
ISOMATCH_API void isomatch_text_free(isomatch_text* text);

/* Two meshes and the map between them. Its layout never changes. */
typedef struct isomatch_mapped_pair {
  const isomatch_mesh* mesh_x;
  const isomatch_mesh* mesh_y;
  /* As of isomatch_result_map: one for each vertex of X. */
  const int32_t* map;
  /* As of isomatch_result_precise_vertices and its weights; or both NULL. */
  const int32_t* precise_vertices;
  const double* precise_weights;
} isomatch_mapped_pair;

/* What a page shows beside the shapes. Each may be NULL. Its layout never
 * changes. */
typedef struct isomatch_page {
  const char* title;
  const char* name_x;
  const char* name_y;
  /* As of isomatch_result_confidence. */
  const float* confidence;
  /* As of isomatch_result_report, or a REPORT.json of the command line. */
  const char* report;
} isomatch_page;

/* Makes the page of `isomatch view`: one HTML document that asks nothing of the
 * network, with both shapes in 3D. `page` may be NULL. */
ISOMATCH_API isomatch_status
isomatch_page_make(const isomatch_mapped_pair* pair, const isomatch_page* page,
                   isomatch_text** html, isomatch_error** error);

/* The same, where what has no counterpart is gray on Y, too. `mask_y`: as of
 * isomatch_result_mask_y, or NULL. */
ISOMATCH_API isomatch_status isomatch_page_make_masked(
    const isomatch_mapped_pair* pair, const isomatch_page* page,
    const uint8_t* mask_y, isomatch_text** html, isomatch_error** error);

/* Carries texture coordinates from Y to X: u and v of each corner of each face,
 * NaN for none. No face of X gets them from two sides of a seam. `uv_y` has
 * num_faces of Y times 6 numbers, `uv_x` gets num_faces of X times 6. */
ISOMATCH_API isomatch_status
isomatch_carry_texture(const isomatch_mapped_pair* pair, const double* uv_y,
                       double* uv_x, isomatch_error** error);

#ifdef __cplusplus
} /* extern "C" */
#endif

#endif /* ISOMATCH_H_ */
