/* Calls in an order that nobody would write, with paths and types that are not there: an error each time, and nothing else. */
#include <conduit_blueprint.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check.h"

static long told = 0;
static void note(const char* message, const char* file, int line)
{
  CHECK(message[0] != 0 && file[0] != 0 && line > 0);
  ++told;
}

static uint64_t state;
static unsigned chance(unsigned below)
{
  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return (unsigned)(state >> 33) % below;
}

static const char* PATHS[] = { "a", "b", "a/b", "b/c/d", "", "/", "//a", "..", "a/..", "../a", "a/../b", ".", "[0]", "[7]", "a/", "0",
  "coordsets", "values", "type", "topologies", "\xff\xfe", "a b" };
static const char* path(void) { return PATHS[chance(sizeof PATHS / sizeof PATHS[0])]; }

static const char* TEXTS[] = { "", "{}", "[]", "1", "{a: 1, b: [1, 2], c: {d: text}}", "[1, x, {a: b}]", "{a: 1, a: 2}", "{", "a: [*b]",
  "a: &x 1\nb: *x", "- 1\n- - 2", "{dtype: int32, value: [1, 2]}", "{x: {dtype: float64, number_of_elements: 2}, y: uint8}",
  "{dtype: int32, number_of_elements: 9223372036854775807}", "{coordsets: {c: {type: uniform, dims: {i: 2, j: 2}}}, topologies: {t: {type: uniform, coordset: c}}}",
  "{coordsets: {c: {type: explicit, values: {x: [0.0, 1.0]}}}, topologies: {t: {type: points, coordset: c}}, fields: {f: {association: vertex, topology: t, values: [1, 2]}}}",
  "{topologies: {t: {type: unstructured, coordset: c, elements: {shape: polyhedral, connectivity: [5, -1], sizes: [9], offsets: [-2]}}}, coordsets: {c: {type: explicit, values: {x: [0.0]}}}}",
  "{target: 3}", "{indent: -1, protocol: yaml, depth: 3}" };
static const char* text(void) { return TEXTS[chance(sizeof TEXTS / sizeof TEXTS[0])]; }

static const char* PROTOCOLS[] = { "json", "yaml", "conduit_json", "conduit_base64_json", "nonsense", "" };
static const char* protocol(void) { return PROTOCOLS[chance(6)]; }

static double shared[8] = { 0, 1, 2, 3, 4, 5, 6, 7 };

/* A node somewhere below a root. */
static conduit_node* below(conduit_node* root)
{
  for (int i = 0; i < 4 && chance(2); ++i)
  {
    const conduit_index_t count = conduit_node_number_of_children(root);
    if (count == 0) break;
    root = conduit_node_child(root, chance((unsigned)count));
  }
  return root;
}

#define READ(stem, type)                                                                                     \
  {                                                                                                          \
    (void)conduit_node_as_##stem(node);                                                                      \
    type* all = conduit_node_as_##stem##_ptr(node);                                                          \
    if (all != NULL && conduit_node_number_of_elements(node) > 0) (void)*(volatile type*)all;                \
    (void)conduit_node_fetch_path_as_##stem(node, path());                                                   \
    (void)conduit_node_fetch_path_as_##stem##_ptr(node, path());                                             \
  }
#define WRITE(stem, type)                                                                                    \
  {                                                                                                          \
    type values[3] = { 1, 2, 3 };                                                                            \
    switch (chance(4))                                                                                       \
    {                                                                                                        \
      case 0: conduit_node_set_##stem(node, 5); break;                                                       \
      case 1: conduit_node_set_##stem##_ptr(node, values, chance(4)); break;                                 \
      case 2: conduit_node_set_path_##stem(node, path(), 6); break;                                          \
      default: conduit_node_set_path_##stem##_ptr_detailed(node, path(), values, 2, 0, 2 * sizeof(type), sizeof(type), 0); \
    }                                                                                                        \
  }

static void one(conduit_node** roots)
{
  conduit_node* node = below(roots[chance(4)]);
  conduit_node* other = below(roots[chance(4)]);
  char* written = NULL;
  switch (chance(44))
  {
    case 0: conduit_node_parse(node, text(), protocol()); break;
    case 1: conduit_node_reset(node); break;
    case 2: (void)conduit_node_fetch(node, path()); break;
    case 3: (void)conduit_node_fetch_existing(node, path()); break;
    case 4: conduit_node_append(node); break;
    case 5: conduit_node_remove_path(node, path()); break;
    case 6: conduit_node_remove_child(node, chance(4)); break;
    case 7: conduit_node_remove_child_by_name(node, path()); break;
    case 8: conduit_node_rename_child(node, path(), path()); break;
    case 9: conduit_node_add_child(node, path()); break;
    case 10: conduit_node_set_node(node, other); break;
    case 11: conduit_node_set_path_node(node, path(), other); break;
    case 12: conduit_node_move(node, other); break;
    case 13: conduit_node_swap(node, other); break;
    case 14: conduit_node_update(node, other); break;
    case 15: conduit_node_update_compatible(node, other); break;
    case 16: (void)conduit_node_diff(node, other, below(roots[chance(4)]), 0); break;
    case 17: (void)conduit_node_diff_compatible(node, other, below(roots[chance(4)]), 1e-3); break;
    case 18: conduit_node_info(node, other); break;
    case 19: conduit_node_compact_to(node, other); break;
    case 20: conduit_node_set_char8_str(node, text()); break;
    case 21: conduit_node_set_path_char8_str(node, path(), text()); break;
    case 22: (void)conduit_node_as_char8_str(node); (void)conduit_node_fetch_path_as_char8_str(node, path()); break;
    case 23: conduit_node_set_external_double_ptr(node, shared, chance(9)); break;
    case 24: conduit_node_set_path_external_double_ptr_detailed(node, path(), shared, 3, 8, 16, 8, 0); break;
    case 25: READ(int8, conduit_int8) READ(uint64, conduit_uint64) READ(double, double) break;
    case 26: READ(int, int) READ(float, float) READ(long, long) READ(char, char) break;
    case 27: WRITE(int32, conduit_int32) break;
    case 28: WRITE(float64, conduit_float64) break;
    case 29: WRITE(uint8, conduit_uint8) break;
    case 30: written = conduit_node_to_json(node); break;
    case 31: written = conduit_node_to_yaml(node); break;
    case 32: written = conduit_node_to_summary_string_with_options(node, other); break;
    case 33: written = conduit_node_to_json_with_options(node, other); break;
    case 34: (void)conduit_blueprint_mesh_verify(node, other); break;
    case 35: (void)conduit_blueprint_verify(chance(2) ? "mcarray" : "table", node, other); break;
    case 36: conduit_blueprint_mesh_generate_index(node, path(), 1, other); break;
    case 37: conduit_blueprint_mesh_partition(node, below(roots[chance(4)]), other); break;
    case 38: conduit_blueprint_mesh_flatten(node, below(roots[chance(4)]), other); break;
    case 39: (void)conduit_blueprint_mcarray_to_interleaved(node, other); break;
    case 40: conduit_node_generate(node, "{x: {dtype: float64, number_of_elements: 2}, y: {dtype: uint8, offset: 3}}", "conduit_json", shared); break;
    case 41:
      CHECK(conduit_node_is_root(node) == (conduit_node_parent(node) == NULL));
      (void)conduit_node_total_strided_bytes(node);
      (void)conduit_node_is_contiguous(node);
      (void)conduit_node_contiguous_with_node(node, other);
      (void)conduit_node_compatible(node, other);
      (void)conduit_node_data_ptr(node);
      (void)conduit_node_element_ptr(node, 0);
      break;
    case 42: free(conduit_node_path(node)); free(conduit_node_name(node)); (void)conduit_node_has_child(node, path()); break;
    default: (void)conduit_node_has_path(node, path()); (void)conduit_node_child(node, chance(6)); (void)conduit_node_child_by_name(node, path());
  }
  free(written);
}

int main(int argc, char** argv)
{
  conduit_utils_set_error_handler(note);
  conduit_utils_set_warning_handler(note);
  state = argc > 1 ? strtoull(argv[1], NULL, 10) : 1;
  const long steps = argc > 2 ? strtol(argv[2], NULL, 10) : 4000;
  conduit_node* roots[4];
  for (int i = 0; i < 4; ++i) roots[i] = conduit_node_create();
  for (long step = 0; step < steps; ++step)
  {
    one(roots);
    /* Trees that have grown large make room for new ones. */
    for (int i = 0; i < 4; ++i)
      if (conduit_node_total_bytes_compact(roots[i]) > 1 << 16) conduit_node_reset(roots[i]);
  }
  CHECK(told > steps / 10);
  for (int i = 0; i < 4; ++i) conduit_node_destroy(roots[i]);
  puts("rubbish.c: ok");
  return 0;
}
