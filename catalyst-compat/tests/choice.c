/* Which pipelines run at a step: catalyst/state/pipelines, a list of the names that catalyst_initialize gave them.
 *
 *   cc -rdynamic choice.c -o choice -ldl -lm && ./choice libtombolo_catalyst.so pipelines.json
 *
 * Without a configuration: three steps of two channels, which nobody said are to be watched.
 *
 * Writes a-<cycle>.vtu and b-<cycle>.vtu by two pipelines of its own, and whatever the configuration `both` writes. */
#include <dlfcn.h>

#include "foreign.h"

static void writer(conduit_node* setup, const char* name)
{
  char path[128], file[64];
  snprintf(path, sizeof path, "catalyst/pipelines/%s/type", name);
  text(setup, path, "io");
  snprintf(path, sizeof path, "catalyst/pipelines/%s/filename", name);
  snprintf(file, sizeof file, "%s-{timestep}.vtu", name);
  text(setup, path, file);
  snprintf(path, sizeof path, "catalyst/pipelines/%s/channel", name);
  text(setup, path, "grid");
}

/* A channel of one tetrahedron. */
static void channel(conduit_node* node, const char* name)
{
  static const char* axes[] = { "x", "y", "z" };
  static double values[3][4] = { { 0, 1, 0, 0 }, { 0, 0, 1, 0 }, { 0, 0, 0, 1 } };
  static int32_t tet[4] = { 0, 1, 2, 3 };
  conduit_node* own = at(at(node, "catalyst/channels"), name);
  text(own, "type", "mesh");
  conduit_node* mesh = at(own, "data");
  text(mesh, "coordsets/coords/type", "explicit");
  for (int axis = 0; axis < 3; ++axis) {
    char path[64];
    snprintf(path, sizeof path, "coordsets/coords/values/%s", axes[axis]);
    array(mesh, path, FLOAT64, values[axis], 4, 0, 0);
  }
  text(mesh, "topologies/mesh/type", "unstructured");
  text(mesh, "topologies/mesh/coordset", "coords");
  text(mesh, "topologies/mesh/elements/shape", "tet");
  array(mesh, "topologies/mesh/elements/connectivity", INT32, tet, 4, 0, 0);
}

/* A step; `names` are chosen where they are given, up to a null. */
static int step(const struct catalyst_impl* impl, int cycle, const char* where, const char** names)
{
  static conduit_node node;
  clear(&node);
  integer(&node, "catalyst/state/timestep", cycle);
  number(&node, "catalyst/state/time", 0.1 * cycle);
  channel(&node, "grid");
  if (!where) channel(&node, "other grid");
  if (names) {
    conduit_node* chosen = at(&node, where);
    if (!*names) integer(&node, where, 0);
    for (; *names; ++names) {
      conduit_node* child = add(chosen, "", 0, LIST);
      put(child, TEXT, *names, (int64_t)strlen(*names) + 1, 0, 1, 1);
    }
  }
  return impl->execute(&node);
}

int main(int argc, char** argv)
{
  void* library = argc > 1 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  const struct catalyst_impl* impl = library ? dlsym(library, "catalyst_api_impl") : NULL;
  if (!impl) return 1;
  static conduit_node setup, end, results;
  if (argc == 2) {
    if (impl->initialize(&setup) || impl->results(&results)) return 1;
    if (!walk(&results, "catalyst/steering/fields/stop/values", 0)) return 1;
    for (int cycle = 0; cycle < 3; ++cycle)
      if (step(impl, cycle, NULL, NULL)) return 1;
    return impl->finalize(&end);
  }
  writer(&setup, "a");
  writer(&setup, "b");
  text(&setup, "catalyst/scripts/both", argv[2]);
  text(&setup, "catalyst/scripts/python", "views.py");
  if (impl->initialize(&setup)) return 1;
  const char *nothing[] = { NULL }, *a[] = { "a", NULL }, *both[] = { "python", "both", NULL }, *inner[] = { "inner", "b", NULL };
  const char* wrong[] = { "bothh", NULL };
  const char* here = "catalyst/state/pipelines";
  const int wanted[] = { 0, 0, 0, 0, 0, 100, 0 };
  const int found[] = { step(impl, 0, here, NULL), step(impl, 1, here, a), step(impl, 2, here, nothing), step(impl, 3, "catalyst/pipelines", both),
    step(impl, 4, here, inner), step(impl, 5, here, wrong), step(impl, 6, here, NULL) };
  for (int cycle = 0; cycle < 7; ++cycle)
    if (found[cycle] != wanted[cycle]) {
      fprintf(stderr, "cycle %d: %d where %d is expected\n", cycle, found[cycle], wanted[cycle]);
      return 1;
    }
  return impl->finalize(&end);
}
