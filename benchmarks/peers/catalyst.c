/* A channel of tetrahedra shown to catalyst_execute when nothing is due.
 *
 *   catalyst CUBES-ALONG-AN-EDGE CALLS
 *
 * Prints one JSON object: seconds and bytes allocated for each call, and the memory that the attached implementation has added. */
#include <catalyst.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

extern void* __libc_malloc(size_t);
extern void* __libc_calloc(size_t, size_t);
extern void* __libc_realloc(void*, size_t);

/* What this thread allocates; other threads do as they like. */
static __thread size_t allocated;
void* malloc(size_t bytes)
{
  allocated += bytes;
  return __libc_malloc(bytes);
}
void* calloc(size_t count, size_t bytes)
{
  allocated += count * bytes;
  return __libc_calloc(count, bytes);
}
void* realloc(void* old, size_t bytes)
{
  allocated += bytes;
  return __libc_realloc(old, bytes);
}

static double now(void)
{
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* Kilobytes in memory. */
static long resident(void)
{
  FILE* file = fopen("/proc/self/status", "r");
  char line[128];
  long kilobytes = -1;
  while (file && fgets(line, sizeof line, file))
    if (sscanf(line, "VmRSS: %ld", &kilobytes) == 1) break;
  if (file) fclose(file);
  return kilobytes;
}

/* Waits until what the implementation makes ready on other threads is done. */
static void settle(void)
{
  const struct timespec pause = { 0, 500000000 };
  clock_t begun;
  do {
    begun = clock();
    nanosleep(&pause, NULL);
  } while (clock() - begun > CLOCKS_PER_SEC / 50);
}

static int compare(const void* a, const void* b)
{
  const double x = *(const double*)a, y = *(const double*)b;
  return (x > y) - (x < y);
}

int main(int argc, char** argv)
{
  const long n = argc > 1 ? atol(argv[1]) : 60, calls = argc > 2 ? atol(argv[2]) : 2000;
  const long side = n + 1, vertices = side * side * side, tets = 6 * n * n * n;
  static const int paths[6][3] = { { 0, 1, 2 }, { 1, 2, 0 }, { 2, 0, 1 }, { 0, 2, 1 }, { 2, 1, 0 }, { 1, 0, 2 } };
  const long step[3] = { side * side, side, 1 };
  double* points = malloc(3 * sizeof(double) * (size_t)vertices);
  double* pressure = calloc((size_t)vertices, sizeof(double));
  double* velocity = calloc(3 * (size_t)vertices, sizeof(double));
  int32_t* connectivity = malloc(4 * sizeof(int32_t) * (size_t)tets);
  for (long v = 0; v < vertices; ++v) {
    points[3 * v] = (double)(v / (side * side)) / (double)n;
    points[3 * v + 1] = (double)(v / side % side) / (double)n;
    points[3 * v + 2] = (double)(v % side) / (double)n;
    pressure[v] = points[3 * v];
    velocity[3 * v] = velocity[3 * v + 1] = velocity[3 * v + 2] = 1.0;
  }
  int32_t* tet = connectivity;
  for (long cube = 0; cube < n * n * n; ++cube)
    for (int path = 0; path < 6; ++path, tet += 4) {
      tet[0] = (int32_t)(cube / (n * n) * step[0] + cube / n % n * step[1] + cube % n);
      for (int edge = 0; edge < 3; ++edge) tet[edge + 1] = tet[edge] + (int32_t)step[paths[path][edge]];
      if (path >= 3) {
        const int32_t swapped = tet[1];
        tet[1] = tet[2];
        tet[2] = swapped;
      }
    }

  conduit_node* setup = conduit_node_create();
  conduit_node* node = conduit_node_create();
  conduit_node_set_path_char8_str(node, "catalyst/channels/fluid/type", "mesh");
  conduit_node* mesh = conduit_node_fetch(node, "catalyst/channels/fluid/data");
  conduit_node_set_path_char8_str(mesh, "coordsets/coords/type", "explicit");
  static const char* const axes[3] = { "x", "y", "z" };
  char path[64];
  for (int axis = 0; axis < 3; ++axis) {
    snprintf(path, sizeof path, "coordsets/coords/values/%s", axes[axis]);
    conduit_node_set_path_external_float64_ptr_detailed(mesh, path, points, vertices, 8 * axis, 24, 8, 0);
    snprintf(path, sizeof path, "fields/velocity/values/%s", axes[axis]);
    conduit_node_set_path_external_float64_ptr_detailed(mesh, path, velocity, vertices, 8 * axis, 24, 8, 0);
  }
  conduit_node_set_path_char8_str(mesh, "topologies/mesh/type", "unstructured");
  conduit_node_set_path_char8_str(mesh, "topologies/mesh/coordset", "coords");
  conduit_node_set_path_char8_str(mesh, "topologies/mesh/elements/shape", "tet");
  conduit_node_set_path_external_int32_ptr(mesh, "topologies/mesh/elements/connectivity", connectivity, 4 * tets);
  conduit_node_set_path_char8_str(mesh, "fields/velocity/association", "vertex");
  conduit_node_set_path_char8_str(mesh, "fields/velocity/topology", "mesh");
  conduit_node_set_path_char8_str(mesh, "fields/pressure/association", "vertex");
  conduit_node_set_path_char8_str(mesh, "fields/pressure/topology", "mesh");
  conduit_node_set_path_external_float64_ptr(mesh, "fields/pressure/values", pressure, vertices);

  double* seconds = malloc(sizeof(double) * (size_t)calls);
  memset(seconds, 0, sizeof(double) * (size_t)calls);
  const long before = resident();
  if (catalyst_initialize(setup) != catalyst_status_ok) return 1;
  size_t most = 0;
  for (long call = 0; call < calls + 10; ++call) {
    conduit_node_set_path_int64(node, "catalyst/state/timestep", call + 1);
    conduit_node_set_path_float64(node, "catalyst/state/time", 1e-3 * (double)call);
    /* The first calls set up; one more takes in what has been made ready. */
    if (call == 9) settle();
    const size_t had = allocated;
    const double begun = now();
    if (catalyst_execute(node) != catalyst_status_ok) return 1;
    if (call < 10) continue;
    seconds[call - 10] = now() - begun;
    if (allocated - had > most) most = allocated - had;
  }
  const long after = resident();
  qsort(seconds, (size_t)calls, sizeof(double), compare);
  printf("{\"tets\": %ld, \"seconds\": %.9f, \"p95\": %.9f, \"allocated\": %zu, \"added_bytes\": %ld, \"mesh_bytes\": %ld}\n", tets,
    seconds[calls / 2], seconds[calls * 95 / 100], most, 1024 * (after - before), 16 * tets + 56 * vertices);
  catalyst_finalize(setup);
  conduit_node_destroy(setup);
  conduit_node_destroy(node);
  return 0;
}
