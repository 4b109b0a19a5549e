/* A host that speaks Catalyst 2: a small Conduit of its own under the names libcatalyst exports, and the calls a solver makes.
 *
 *   cc -rdynamic host.c -o host -ldl && ./host libtombolo_catalyst.so
 *
 * Exits with 0 when every answer is the one expected; else prints the first that is not and exits with 1. */
#include <dlfcn.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct conduit_node {
  const char* path[16];
  int64_t type[16];
  double number[16];
  const char* text[16];
  int count;
  int child; /* of a fetched child: the entry it stands for */
  struct conduit_node* parent;
} conduit_node;
typedef struct { int64_t id; } conduit_datatype;

static int find(const conduit_node* node, const char* path)
{
  for (int i = 0; i < node->count; ++i)
    if (strcmp(node->path[i], path) == 0) return i;
  return -1;
}

int catalyst_conduit_node_has_path(const conduit_node* node, const char* path)
{
  size_t length = strlen(path);
  for (int i = 0; i < node->count; ++i)
    if (strncmp(node->path[i], path, length) == 0 && (node->path[i][length] == 0 || node->path[i][length] == '/')) return 1;
  return 0;
}

conduit_node* catalyst_conduit_node_fetch_existing(conduit_node* node, const char* path)
{
  static conduit_node children[64];
  static int next = 0;
  conduit_node* child = &children[next++ % 64];
  child->parent = node;
  child->child = find(node, path);
  return child;
}

const conduit_datatype* catalyst_conduit_node_dtype(const conduit_node* node)
{
  static conduit_datatype types[64];
  static int next = 0;
  conduit_datatype* type = &types[next++ % 64];
  type->id = node->child < 0 ? 1 : node->parent->type[node->child];
  return type;
}

int64_t catalyst_conduit_datatype_id(const conduit_datatype* type) { return type->id; }
int64_t catalyst_conduit_datatype_number_of_elements(const conduit_datatype* type) { return type->id > 2; }

/* Real Conduit throws when a value is read as what it is not: here that ends the test. */
static double read_as(const conduit_node* node, int64_t type)
{
  if (node->child < 0 || node->parent->type[node->child] != type) {
    fprintf(stderr, "a value was read as a type it does not have\n");
    exit(1);
  }
  return node->parent->number[node->child];
}
int32_t catalyst_conduit_node_as_int32(const conduit_node* node) { return (int32_t)read_as(node, 5); }
int64_t catalyst_conduit_node_as_int64(const conduit_node* node) { return (int64_t)read_as(node, 6); }
uint32_t catalyst_conduit_node_as_uint32(const conduit_node* node) { return (uint32_t)read_as(node, 9); }
uint64_t catalyst_conduit_node_as_uint64(const conduit_node* node) { return (uint64_t)read_as(node, 10); }
float catalyst_conduit_node_as_float32(const conduit_node* node) { return (float)read_as(node, 11); }
double catalyst_conduit_node_as_float64(const conduit_node* node) { return read_as(node, 12); }

static void put(conduit_node* node, const char* path, int64_t type, double number, const char* text)
{
  int i = node->count++;
  node->path[i] = strdup(path);
  node->type[i] = type;
  node->number[i] = number;
  node->text[i] = text ? strdup(text) : NULL;
}
void catalyst_conduit_node_set_path_char8_str(conduit_node* node, const char* path, const char* text)
{
  put(node, path, 13, 0, text);
}
void catalyst_conduit_node_set_path_int32(conduit_node* node, const char* path, int32_t value)
{
  put(node, path, 5, value, NULL);
}

struct catalyst_impl {
  int version;
  int (*initialize)(const conduit_node*);
  int (*execute)(const conduit_node*);
  int (*finalize)(const conduit_node*);
  int (*about)(conduit_node*);
  int (*results)(conduit_node*);
};

static void expect(const char* what, int found, int wanted)
{
  if (found != wanted) {
    fprintf(stderr, "%s: %d where %d is expected\n", what, found, wanted);
    exit(1);
  }
}

static void expect_text(const conduit_node* node, const char* path, const char* wanted)
{
  int i = find(node, path);
  if (i < 0 || node->text[i] == NULL || strcmp(node->text[i], wanted) != 0) {
    fprintf(stderr, "%s: '%s' where '%s' is expected\n", path, i < 0 ? "nothing" : node->text[i], wanted);
    exit(1);
  }
}

int main(int argc, char** argv)
{
  void* library = argc > 1 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  if (library == NULL) {
    fprintf(stderr, "%s\n", argc > 1 ? dlerror() : "which library?");
    return 1;
  }
  const struct catalyst_impl* impl = dlsym(library, "catalyst_api_impl");
  if (impl == NULL) {
    fprintf(stderr, "catalyst_api_impl is not exported\n");
    return 1;
  }
  expect("version", impl->version, 1);

  conduit_node about = { 0 };
  expect("about before initialize", impl->about(&about), 0);
  expect_text(&about, "catalyst/version", "2.0.0");
  expect_text(&about, "catalyst/abi_version", "3");
  expect_text(&about, "catalyst/implementation", "tombolo");
  expect("catalyst/use_mpi", find(&about, "catalyst/use_mpi") >= 0, 1);
  expect("about(NULL)", impl->about(NULL), 100);

  conduit_node empty = { 0 };
  expect("execute before initialize", impl->execute(&empty), 1);
  expect("results before initialize", impl->results(&empty), 1);
  expect("finalize before initialize", impl->finalize(&empty), 1);
  expect("initialize(NULL)", impl->initialize(NULL), 100);
  expect("a null node does not initialize", impl->execute(&empty), 1);
  expect("initialize", impl->initialize(&empty), 0);
  expect("a second initialize", impl->initialize(&empty), 0);

  expect("execute(NULL)", impl->execute(NULL), 100);
  expect("execute without catalyst", impl->execute(&empty), 100);

  conduit_node timestep = { 0 };
  put(&timestep, "catalyst/state/timestep", 6, 7, NULL);
  expect("no time", impl->execute(&timestep), 100);
  put(&timestep, "catalyst/state/time", 12, 0.7, NULL);
  expect("timestep as int64", impl->execute(&timestep), 0);

  int64_t integers[] = { 5, 6, 9, 10 };
  for (int i = 0; i < 4; ++i) {
    conduit_node cycle = { 0 };
    put(&cycle, "catalyst/state/cycle", integers[i], 7, NULL);
    put(&cycle, "catalyst/state/time", 11, 0.5, NULL);
    expect("cycle of each integer type", impl->execute(&cycle), 0);
  }

  conduit_node negative = { 0 };
  put(&negative, "catalyst/state/cycle", 5, -1, NULL);
  put(&negative, "catalyst/state/time", 12, 0, NULL);
  expect("a negative cycle", impl->execute(&negative), 100);

  conduit_node text = { 0 };
  put(&text, "catalyst/state/cycle", 13, 0, "seven");
  put(&text, "catalyst/state/time", 12, 0, NULL);
  expect("a cycle in words", impl->execute(&text), 100);

  conduit_node nan_time = { 0 };
  put(&nan_time, "catalyst/state/cycle", 5, 1, NULL);
  put(&nan_time, "catalyst/state/time", 12, NAN, NULL);
  expect("a time that is NaN", impl->execute(&nan_time), 100);

  conduit_node object = { 0 };
  put(&object, "catalyst/state/cycle/deeper", 5, 1, NULL);
  put(&object, "catalyst/state/time", 12, 0, NULL);
  expect("a cycle that is an object", impl->execute(&object), 100);

  put(&timestep, "catalyst/channels/grid/type", 13, 0, "mesh");
  expect("channels", impl->execute(&timestep), 103);
  expect("channels again", impl->execute(&timestep), 103);

  expect("results", impl->results(&empty), 0);
  expect("results(NULL)", impl->results(NULL), 100);
  expect("finalize(NULL)", impl->finalize(NULL), 100);
  expect("finalize", impl->finalize(&empty), 0);
  expect("execute after finalize", impl->execute(&timestep), 1);
  expect("initialize after finalize", impl->initialize(&empty), 0);
  return 0;
}
