/* Starts that fail, and ends that fail: what is left of each.
 *
 *   cc -rdynamic starts.c -o starts -ldl -lm && ./starts libtombolo_catalyst.so pipelines.json
 *
 * Writes files beside the configuration: the last report is pipelines.json.report. */
#include <dlfcn.h>

#include "foreign.h"

static const struct catalyst_impl* impl;
static conduit_node setup, node;

static void expect(const char* what, int found, int wanted)
{
  if (found == wanted) return;
  fprintf(stderr, "%s: %d where %d is expected\n", what, found, wanted);
  exit(1);
}

/* A step of one tetrahedron. */
static conduit_node* step(int cycle)
{
  static double xyz[12] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1 };
  static int32_t tet[4] = { 0, 1, 2, 3 };
  clear(&node);
  integer(&node, "catalyst/state/timestep", cycle);
  number(&node, "catalyst/state/time", 0.1 * cycle);
  text(&node, "catalyst/channels/grid/type", "mesh");
  conduit_node* mesh = at(&node, "catalyst/channels/grid/data");
  unstructured(mesh, "tet", xyz, 4, tet, 4);
  return &node;
}

int main(int argc, char** argv)
{
  void* library = argc > 2 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  impl = library ? dlsym(library, "catalyst_api_impl") : NULL;
  if (impl == NULL) return 2;
  static char saved[512], restart[512], report[512], nowhere[512];
  snprintf(saved, sizeof saved, "%s.saved", argv[2]);
  snprintf(restart, sizeof restart, "%s.restart", argv[2]);
  snprintf(report, sizeof report, "%s.report", argv[2]);
  snprintf(nowhere, sizeof nowhere, "%s.no-such-directory/report", argv[2]);

  number(&setup, "catalyst/parameters/inflow/value", 50);
  number(&setup, "catalyst/parameters/inflow/minimum", 0);
  number(&setup, "catalyst/parameters/inflow/maximum", 40);
  expect("a parameter out of its bounds", impl->initialize(&setup), 100);
  clear(&setup);

  /* A second configuration that cannot be read leaves the run as it is. */
  text(&setup, "catalyst/scripts/script", argv[2]);
  expect("initialize", impl->initialize(&setup), 0);
  expect("a step", impl->execute(step(0)), 0);
  clear(&setup);
  text(&setup, "catalyst/scripts/script", "no-such-file.json");
  expect("a second configuration that is not there", impl->initialize(&setup), 100);
  expect("a step of the first run", impl->execute(step(1)), 0);

  /* The end of the first run fails, and the second begins all the same. */
  setenv("TOMBOLO_REPORT", nowhere, 1);
  clear(&setup);
  text(&setup, "catalyst/scripts/script", argv[2]);
  expect("a report that cannot be written, of the run before", impl->initialize(&setup), 102);
  expect("a step of the second run", impl->execute(step(0)), 0);
  expect("a report that cannot be written", impl->finalize(&setup), 102);
  expect("that run has ended", impl->execute(step(1)), 1);
  unsetenv("TOMBOLO_REPORT");

  /* Nobody says what is watched, and what the run is to go on from comes late: each failed start leaves the next as it was. */
  clear(&setup);
  expect("initialize without a configuration", impl->initialize(&setup), 0);
  step(0);
  text(&node, "catalyst/state/checkpoint", saved);
  expect("a checkpoint", impl->execute(&node), 0);
  expect("finalize", impl->finalize(&setup), 0);
  setenv("TOMBOLO_REPORT", report, 1);
  text(&setup, "catalyst/restart", restart);
  expect("initialize with a restart", impl->initialize(&setup), 0);
  for (int attempt = 0; attempt < 3; ++attempt) expect("no checkpoint yet", impl->execute(step(1)), 102);
  if (rename(saved, restart) != 0) return 1;
  expect("the checkpoint is there", impl->execute(step(1)), 0);
  expect("finalize the last", impl->finalize(&setup), 0);
  clear(&setup);
  clear(&node);
  return 0;
}
