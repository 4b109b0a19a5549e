/* A Conduit that is not ours, small enough to be read at a glance: a tree of nodes under the names that libcatalyst exports. Whatever
 * the real one answers with a C++ exception ends the program here. */
#ifndef foreign_h
#define foreign_h

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
  int64_t id, count, offset, stride, bytes, endianness;
} conduit_datatype;

typedef struct conduit_node {
  char* name;
  conduit_datatype type;
  char* data;
  int owned;
  struct conduit_node* children[64];
  int64_t child_count;
} conduit_node;

enum { EMPTY, OBJECT, LIST, INT8, INT16, INT32, INT64, UINT8, UINT16, UINT32, UINT64, FLOAT32, FLOAT64, TEXT };

static int64_t bytes_of(int64_t id)
{
  static const int64_t bytes[] = { 0, 0, 0, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8, 1 };
  return bytes[id];
}

static void thrown(const char* what, const char* where)
{
  fprintf(stderr, "Conduit would throw: %s '%s'\n", what, where);
  exit(70);
}

static conduit_node* find(const conduit_node* node, const char* name, size_t length)
{
  for (int64_t i = 0; i < node->child_count; ++i)
    if (node->children[i]->name && strlen(node->children[i]->name) == length && !strncmp(node->children[i]->name, name, length))
      return node->children[i];
  return NULL;
}

static void clear(conduit_node* node)
{
  for (int64_t i = 0; i < node->child_count; ++i) {
    clear(node->children[i]);
    free(node->children[i]->name);
    free(node->children[i]);
  }
  node->child_count = 0;
  if (node->owned) free(node->data);
  node->data = NULL;
  node->owned = 0;
  memset(&node->type, 0, sizeof node->type);
}

static conduit_node* add(conduit_node* node, const char* name, size_t length, int64_t kind)
{
  if (node->type.id != kind) {
    clear(node);
    node->type.id = kind;
  }
  if (node->child_count == 64) thrown("too many children", name);
  conduit_node* child = calloc(1, sizeof *child);
  child->name = kind == LIST ? NULL : strndup(name, length);
  node->children[node->child_count++] = child;
  return child;
}

static conduit_node* walk(conduit_node* node, const char* path, int make)
{
  while (node && *path) {
    const size_t length = strcspn(path, "/");
    conduit_node* next = find(node, path, length);
    if (!next && make) next = add(node, path, length, OBJECT);
    node = next;
    path += length + (path[length] == '/');
  }
  return node;
}

static void put(conduit_node* node, int64_t id, const void* data, int64_t count, int64_t offset, int64_t stride, int copy)
{
  clear(node);
  conduit_datatype type = { id, count, copy ? 0 : offset, copy ? bytes_of(id) : stride, bytes_of(id), 0 };
  node->type = type;
  node->owned = copy;
  node->data = (char*)data;
  if (copy) {
    node->data = malloc((size_t)(count * type.bytes + 1));
    for (int64_t i = 0; i < count; ++i)
      memcpy(node->data + i * type.bytes, (const char*)data + offset + i * stride, (size_t)type.bytes);
  }
}

/* ---- What libcatalyst exports. */

int64_t catalyst_conduit_node_number_of_children(conduit_node* node) { return node->child_count; }
conduit_node* catalyst_conduit_node_child(conduit_node* node, int64_t index)
{
  if (index < 0 || index >= node->child_count) thrown("no child of that number below", node->name ? node->name : "");
  return node->children[index];
}
int catalyst_conduit_node_has_child(const conduit_node* node, const char* name) { return find(node, name, strlen(name)) != NULL; }
conduit_node* catalyst_conduit_node_child_by_name(conduit_node* node, const char* name)
{
  conduit_node* child = find(node, name, strlen(name));
  if (!child) thrown("no child", name);
  return child;
}
char* catalyst_conduit_node_name(const conduit_node* node) { return strdup(node->name ? node->name : ""); }
const conduit_datatype* catalyst_conduit_node_dtype(const conduit_node* node) { return &node->type; }
void* catalyst_conduit_node_element_ptr(conduit_node* node, int64_t index)
{
  if (node->type.id < INT8) thrown("no elements in", node->name ? node->name : "");
  return node->data ? node->data + node->type.offset + index * node->type.stride : NULL;
}
int64_t catalyst_conduit_datatype_id(const conduit_datatype* type) { return type->id; }
int64_t catalyst_conduit_datatype_number_of_elements(const conduit_datatype* type) { return type->count; }
int64_t catalyst_conduit_datatype_stride(const conduit_datatype* type) { return type->stride; }
int64_t catalyst_conduit_datatype_endianness(const conduit_datatype* type) { return type->endianness; }
conduit_node* catalyst_conduit_node_fetch(conduit_node* node, const char* path) { return walk(node, path, 1); }
int catalyst_conduit_node_has_path(const conduit_node* node, const char* path) { return walk((conduit_node*)node, path, 0) != NULL; }
void catalyst_conduit_node_remove_path(conduit_node* node, const char* path)
{
  const char* last = strrchr(path, '/');
  char* above = strndup(path, last ? (size_t)(last - path) : 0);
  conduit_node* parent = walk(node, above, 0);
  free(above);
  const char* name = last ? last + 1 : path;
  conduit_node* child = parent ? find(parent, name, strlen(name)) : NULL;
  if (!child) thrown("no path", path);
  clear(child);
  free(child->name);
  int64_t at = 0;
  while (parent->children[at] != child) ++at;
  free(child);
  memmove(parent->children + at, parent->children + at + 1, sizeof child * (size_t)(--parent->child_count - at));
}
void catalyst_conduit_node_set_path_char8_str(conduit_node* node, const char* path, const char* text)
{
  put(walk(node, path, 1), TEXT, text, (int64_t)strlen(text) + 1, 0, 1, 1);
}
void catalyst_conduit_node_set_path_int32(conduit_node* node, const char* path, int32_t value)
{
  put(walk(node, path, 1), INT32, &value, 1, 0, 4, 1);
}
void catalyst_conduit_node_set_path_int64_ptr(conduit_node* node, const char* path, int64_t* values, int64_t count)
{
  put(walk(node, path, 1), INT64, values, count, 0, 8, 1);
}
void catalyst_conduit_node_set_path_float64(conduit_node* node, const char* path, double value)
{
  put(walk(node, path, 1), FLOAT64, &value, 1, 0, 8, 1);
}
void catalyst_conduit_node_set_path_float64_ptr_detailed(conduit_node* node, const char* path, double* values, int64_t count,
  int64_t offset, int64_t stride, int64_t bytes, int64_t endianness)
{
  (void)bytes, (void)endianness;
  put(walk(node, path, 1), FLOAT64, values, count, offset, stride, 1);
}
static void show(conduit_node* node, const conduit_node* shown)
{
  if (shown->type.id >= INT8) {
    put(node, shown->type.id, shown->data, shown->type.count, shown->type.offset, shown->type.stride, 0);
    return;
  }
  clear(node);
  for (int64_t i = 0; i < shown->child_count; ++i) {
    const char* name = shown->children[i]->name;
    show(add(node, name, strlen(name), OBJECT), shown->children[i]);
  }
}
void catalyst_conduit_node_set_path_external_node(conduit_node* node, const char* path, conduit_node* shown)
{
  show(walk(node, path, 1), shown);
}

/* ---- For the programs. */

static inline conduit_node* at(conduit_node* node, const char* path) { return walk(node, path, 1); }
static inline void text(conduit_node* node, const char* path, const char* value)
{
  catalyst_conduit_node_set_path_char8_str(node, path, value);
}
static inline void number(conduit_node* node, const char* path, double value)
{
  catalyst_conduit_node_set_path_float64(node, path, value);
}
static inline void integer(conduit_node* node, const char* path, int64_t value) { put(at(node, path), INT64, &value, 1, 0, 8, 1); }
/* Borrowed, each `stride` bytes. */
static inline void array(conduit_node* node, const char* path, int64_t id, const void* data, int64_t count, int64_t offset, int64_t stride)
{
  put(at(node, path), id, data, count, offset, stride ? stride : bytes_of(id), 0);
}

/* A mesh of cells of one shape, over points one after the other. Both arrays stay the caller's. */
static inline void unstructured(conduit_node* mesh, const char* shape, const double* xyz, int64_t points, const int32_t* corners, int64_t count)
{
  text(mesh, "coordsets/coords/type", "explicit");
  array(mesh, "coordsets/coords/values/x", FLOAT64, xyz, points, 0, 24);
  array(mesh, "coordsets/coords/values/y", FLOAT64, xyz, points, 8, 24);
  array(mesh, "coordsets/coords/values/z", FLOAT64, xyz, points, 16, 24);
  text(mesh, "topologies/mesh/type", "unstructured");
  text(mesh, "topologies/mesh/coordset", "coords");
  text(mesh, "topologies/mesh/elements/shape", shape);
  array(mesh, "topologies/mesh/elements/connectivity", INT32, corners, count, 0, 0);
}

struct catalyst_impl {
  int version;
  int (*initialize)(const conduit_node*);
  int (*execute)(const conduit_node*);
  int (*finalize)(const conduit_node*);
  int (*about)(conduit_node*);
  int (*results)(conduit_node*);
};

#endif
