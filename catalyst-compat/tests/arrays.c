/* Fields of every type of number, ghosts in one mesh and in one of several blocks, fields of the mesh as a whole, and two grids of a
 * level that touch.
 *
 *   cc -rdynamic arrays.c -o arrays -ldl -lm && ./arrays libtombolo_catalyst.so pipelines.json */
#include <dlfcn.h>

#include "foreign.h"

static conduit_node setup, node;

static conduit_node* channel(const char* name, const char* type)
{
  conduit_node* channel = at(at(&node, "catalyst/channels"), name);
  text(channel, "type", type);
  char path[64];
  snprintf(path, sizeof path, "catalyst/pipelines/%s/type", name);
  text(&setup, path, "io");
  snprintf(path, sizeof path, "catalyst/pipelines/%s/channel", name);
  text(&setup, path, name);
  char file[64];
  snprintf(file, sizeof file, "%s.vtu", name);
  snprintf(path, sizeof path, "catalyst/pipelines/%s/filename", name);
  text(&setup, path, file);
  return at(channel, "data");
}

/* So many cells along x, of width 1. */
static conduit_node* row(conduit_node* mesh, int cells, double x)
{
  text(mesh, "coordsets/coords/type", "uniform");
  integer(mesh, "coordsets/coords/dims/i", cells + 1);
  integer(mesh, "coordsets/coords/dims/j", 2);
  integer(mesh, "coordsets/coords/dims/k", 2);
  number(mesh, "coordsets/coords/origin/x", x);
  text(mesh, "topologies/mesh/type", "uniform");
  text(mesh, "topologies/mesh/coordset", "coords");
  return mesh;
}

static void field(conduit_node* mesh, const char* name, int64_t id, const void* values, int64_t count)
{
  conduit_node* field = at(at(mesh, "fields"), name);
  text(field, "association", "element");
  text(field, "topology", "mesh");
  array(field, "values", id, values, count, 0, 0);
}

static const char* names[] = { "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32", "float64" };
static const int8_t i8[] = { -128, 127, 3 };
static const int16_t i16[] = { -32768, 32767, 3 };
static const int32_t i32[] = { INT32_MIN, INT32_MAX, 3 };
static const int64_t i64[] = { -9007199254740992, 9007199254740992, 3 };
static const uint8_t u8[] = { 0, 255, 3 };
static const uint16_t u16[] = { 0, 65535, 3 };
static const uint32_t u32[] = { 0, UINT32_MAX, 3 };
static const uint64_t u64[] = { 0, 9007199254740992, 3 };
static const float f32[] = { 0.1f, -1e30f, 3 };
static const double f64[] = { 0.1, -1e300, 3 };
static const void* values[] = { i8, i16, i32, i64, u8, u16, u32, u64, f32, f64 };
static const int32_t ghosts[] = { 0, 1, 0 }, two_ghosts[] = { 1, 0 };
static const float times[] = { 0.5f, 0.25f };
static const uint16_t counts[] = { 7 };

int main(int argc, char** argv)
{
  void* library = argc > 1 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  const struct catalyst_impl* impl = library ? dlsym(library, "catalyst_api_impl") : NULL;
  if (!impl) return 1;
  integer(&node, "catalyst/state/cycle", 0);
  number(&node, "catalyst/state/time", 0.0);

  conduit_node* mesh = row(channel("types", "mesh"), 3, 0);
  for (int type = 0; type < 10; ++type) field(mesh, names[type], INT8 + type, values[type], 3);
  field(mesh, "halo", INT32, ghosts, 3);
  text(mesh, "state/metadata/vtk_fields/halo/attribute_type", "Ghosts");
  array(mesh, "state/fields/times", FLOAT32, times, 2, 0, 0);
  array(at(&node, "catalyst/channels/types"), "state/fields/counts", UINT16, counts, 1, 0, 0);
  text(mesh, "state/fields/title", "a text");

  conduit_node* blocks = channel("blocks", "multimesh");
  field(row(at(blocks, "low"), 3, 0), "small", INT16, i16, 3);
  mesh = row(at(blocks, "high"), 2, 2);
  field(mesh, "small", INT16, i16, 2);
  field(mesh, "halo", INT32, two_ghosts, 2);
  text(mesh, "state/metadata/vtk_fields/halo/attribute_type", "Ghosts");

  blocks = channel("levels", "amrmesh");
  for (int grid = 0; grid < 2; ++grid) {
    mesh = row(at(blocks, grid ? "right" : "left"), 2, 2 * grid);
    integer(mesh, "state/domain_id", grid);
    integer(mesh, "state/level", 0);
  }

  if (argc > 2) text(&setup, "catalyst/scripts/watch", argv[2]);
  if (impl->initialize(&setup)) return 1;
  for (int cycle = 0; cycle < 2; ++cycle) {
    integer(&node, "catalyst/state/cycle", cycle);
    number(&node, "catalyst/state/time", cycle);
    if (impl->execute(&node)) return 1;
  }
  if (impl->finalize(&setup)) return 1;
  clear(&setup);
  clear(&node);
  return 0;
}
