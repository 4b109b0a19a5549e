/* The node: a tree of objects and lists whose leaves are numbers, arrays and texts, owned or borrowed.
 *
 * A path is names joined by '/'. What is fetched belongs to the tree it is in: destroying it does nothing. Texts that a function
 * returns as char* from a const node are freed by the caller with free(), but those of conduit_node_as_char8_str are the node's. */
#ifndef conduit_node_h
#define conduit_node_h

#include <stddef.h>
#include <stdlib.h>

#include "conduit_bitwidth_style_types.h"
#include "conduit_datatype.h"
#include "conduit_endianness_types.h"
#include "conduit_c_exports.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct conduit_node_impl conduit_node;

/* Making and unmaking. */
CONDUIT_C_API conduit_node* conduit_node_create(void);
CONDUIT_C_API void conduit_node_destroy(conduit_node* node);
CONDUIT_C_API void conduit_node_reset(conduit_node* node);
CONDUIT_C_API void conduit_node_move(conduit_node* node, conduit_node* other);
CONDUIT_C_API void conduit_node_swap(conduit_node* node, conduit_node* other);

/* Children. fetch makes what is not there; fetch_existing, child and child_by_name do not. */
CONDUIT_C_API conduit_node* conduit_node_fetch(conduit_node* node, const char* path);
CONDUIT_C_API conduit_node* conduit_node_fetch_existing(conduit_node* node, const char* path);
CONDUIT_C_API conduit_node* conduit_node_append(conduit_node* node);
CONDUIT_C_API conduit_node* conduit_node_add_child(conduit_node* node, const char* name);
CONDUIT_C_API conduit_node* conduit_node_child(conduit_node* node, conduit_index_t index);
CONDUIT_C_API conduit_node* conduit_node_child_by_name(conduit_node* node, const char* name);
CONDUIT_C_API conduit_index_t conduit_node_number_of_children(conduit_node* node);
CONDUIT_C_API conduit_index_t conduit_node_number_of_elements(conduit_node* node);
CONDUIT_C_API void conduit_node_remove_path(conduit_node* node, const char* path);
CONDUIT_C_API void conduit_node_remove_child(conduit_node* node, conduit_index_t index);
CONDUIT_C_API void conduit_node_remove_child_by_name(conduit_node* node, const char* name);
CONDUIT_C_API void conduit_node_rename_child(conduit_node* node, const char* current_name, const char* new_name);
CONDUIT_C_API char* conduit_node_name(const conduit_node* node);
CONDUIT_C_API char* conduit_node_path(const conduit_node* node);
CONDUIT_C_API int conduit_node_has_child(const conduit_node* node, const char* name);
CONDUIT_C_API int conduit_node_has_path(const conduit_node* node, const char* path);
CONDUIT_C_API int conduit_node_is_root(conduit_node* node);
CONDUIT_C_API conduit_node* conduit_node_parent(conduit_node* node);

/* Memory. */
CONDUIT_C_API int conduit_node_is_data_external(const conduit_node* node);
CONDUIT_C_API conduit_index_t conduit_node_total_strided_bytes(const conduit_node* node);
CONDUIT_C_API conduit_index_t conduit_node_total_bytes_compact(const conduit_node* node);
CONDUIT_C_API conduit_index_t conduit_node_total_bytes_allocated(const conduit_node* node);
CONDUIT_C_API int conduit_node_is_compact(const conduit_node* node);
CONDUIT_C_API int conduit_node_is_contiguous(const conduit_node* node);
CONDUIT_C_API int conduit_node_contiguous_with_node(const conduit_node* node, const conduit_node* other);
CONDUIT_C_API int conduit_node_contiguous_with_address(const conduit_node* node, void* address);
CONDUIT_C_API void conduit_node_info(const conduit_node* node, conduit_node* result);
CONDUIT_C_API void conduit_node_compact_to(const conduit_node* node, conduit_node* result);

/* Comparing: 1 where there is a difference, which `info` then says. */
CONDUIT_C_API int conduit_node_compatible(const conduit_node* node, const conduit_node* other);
CONDUIT_C_API int conduit_node_diff(
  const conduit_node* node, const conduit_node* other, conduit_node* info, conduit_float64 epsilon);
CONDUIT_C_API int conduit_node_diff_compatible(
  const conduit_node* node, const conduit_node* other, conduit_node* info, conduit_float64 epsilon);

/* Updating. */
CONDUIT_C_API void conduit_node_update(conduit_node* node, const conduit_node* other);
CONDUIT_C_API void conduit_node_update_compatible(conduit_node* node, const conduit_node* other);
CONDUIT_C_API void conduit_node_update_external(conduit_node* node, conduit_node* other);

/* Text and files. Protocols: json, yaml, conduit_json, conduit_base64_json; for files also conduit_bin. */
CONDUIT_C_API void conduit_node_print(conduit_node* node);
CONDUIT_C_API void conduit_node_print_detailed(conduit_node* node);
CONDUIT_C_API char* conduit_node_to_json(const conduit_node* node);
CONDUIT_C_API char* conduit_node_to_json_with_options(const conduit_node* node, const conduit_node* options);
CONDUIT_C_API char* conduit_node_to_yaml(const conduit_node* node);
CONDUIT_C_API char* conduit_node_to_yaml_with_options(const conduit_node* node, const conduit_node* options);
CONDUIT_C_API char* conduit_node_to_string(const conduit_node* node);
CONDUIT_C_API char* conduit_node_to_string_with_options(const conduit_node* node, const conduit_node* options);
CONDUIT_C_API char* conduit_node_to_summary_string(const conduit_node* node);
CONDUIT_C_API char* conduit_node_to_summary_string_with_options(const conduit_node* node, const conduit_node* options);
CONDUIT_C_API void conduit_node_parse(conduit_node* node, const char* text, const char* protocol);
CONDUIT_C_API void conduit_node_generate(conduit_node* node, const char* schema, const char* protocol, void* data);
CONDUIT_C_API void conduit_node_generate_external(
  conduit_node* node, const char* schema, const char* protocol, void* data);
CONDUIT_C_API void conduit_node_save(conduit_node* node, const char* path, const char* protocol);
CONDUIT_C_API void conduit_node_load(conduit_node* node, const char* path, const char* protocol);

/* Setting to a tree or a text: copied, or borrowed (external). */
CONDUIT_C_API void conduit_node_set_node(conduit_node* node, conduit_node* data);
CONDUIT_C_API void conduit_node_set_path_node(conduit_node* node, const char* path, conduit_node* data);
CONDUIT_C_API void conduit_node_set_external_node(conduit_node* node, conduit_node* data);
CONDUIT_C_API void conduit_node_set_path_external_node(conduit_node* node, const char* path, conduit_node* data);
CONDUIT_C_API void conduit_node_set_char8_str(conduit_node* node, const char* value);
CONDUIT_C_API void conduit_node_set_path_char8_str(conduit_node* node, const char* path, const char* value);
CONDUIT_C_API void conduit_node_set_external_char8_str(conduit_node* node, char* value);
CONDUIT_C_API void conduit_node_set_path_external_char8_str(conduit_node* node, const char* path, char* value);
CONDUIT_C_API char* conduit_node_as_char8_str(conduit_node* node);
CONDUIT_C_API char* conduit_node_fetch_path_as_char8_str(conduit_node* node, const char* path);

/* Where the data are. */
CONDUIT_C_API const conduit_datatype* conduit_node_dtype(const conduit_node* node);
CONDUIT_C_API void* conduit_node_data_ptr(conduit_node* node);
CONDUIT_C_API void* conduit_node_element_ptr(conduit_node* node, conduit_index_t index);
CONDUIT_C_API void* conduit_node_fetch_path_data_ptr(conduit_node* node, const char* path);
CONDUIT_C_API void* conduit_node_fetch_node_data_ptr(conduit_node* node, const char* path);
CONDUIT_C_API void* conduit_node_fetch_path_element_ptr(conduit_node* node, const char* path, conduit_index_t index);

/* For each type of number: a value, an array, and an array with its layout (offset, stride and element bytes in bytes), copied or
 * borrowed, here or at a path; the first value and the address, here or at a path. */
#define CONDUIT_NODE_LAYOUT                                                                                  \
  conduit_index_t number_of_elements, conduit_index_t offset, conduit_index_t stride,                        \
    conduit_index_t element_bytes, conduit_index_t endianness
#define CONDUIT_NODE_FAMILY(stem, type)                                                                      \
  CONDUIT_C_API void conduit_node_set_##stem(conduit_node* node, type value);                                  \
  CONDUIT_C_API void conduit_node_set_##stem##_ptr(                                                            \
    conduit_node* node, type* data, conduit_index_t number_of_elements);                                     \
  CONDUIT_C_API void conduit_node_set_##stem##_ptr_detailed(conduit_node* node, type* data, CONDUIT_NODE_LAYOUT); \
  CONDUIT_C_API void conduit_node_set_path_##stem(conduit_node* node, const char* path, type value);           \
  CONDUIT_C_API void conduit_node_set_path_##stem##_ptr(                                                       \
    conduit_node* node, const char* path, type* data, conduit_index_t number_of_elements);                   \
  CONDUIT_C_API void conduit_node_set_path_##stem##_ptr_detailed(                                              \
    conduit_node* node, const char* path, type* data, CONDUIT_NODE_LAYOUT);                                  \
  CONDUIT_C_API void conduit_node_set_external_##stem##_ptr(                                                   \
    conduit_node* node, type* data, conduit_index_t number_of_elements);                                     \
  CONDUIT_C_API void conduit_node_set_external_##stem##_ptr_detailed(                                          \
    conduit_node* node, type* data, CONDUIT_NODE_LAYOUT);                                                    \
  CONDUIT_C_API void conduit_node_set_path_external_##stem##_ptr(                                              \
    conduit_node* node, const char* path, type* data, conduit_index_t number_of_elements);                   \
  CONDUIT_C_API void conduit_node_set_path_external_##stem##_ptr_detailed(                                     \
    conduit_node* node, const char* path, type* data, CONDUIT_NODE_LAYOUT);                                  \
  CONDUIT_C_API type conduit_node_as_##stem(conduit_node* node);                                               \
  CONDUIT_C_API type* conduit_node_as_##stem##_ptr(conduit_node* node);                                        \
  CONDUIT_C_API type conduit_node_fetch_path_as_##stem(conduit_node* node, const char* path);                  \
  CONDUIT_C_API type* conduit_node_fetch_path_as_##stem##_ptr(conduit_node* node, const char* path)

CONDUIT_NODE_FAMILY(int8, conduit_int8);
CONDUIT_NODE_FAMILY(int16, conduit_int16);
CONDUIT_NODE_FAMILY(int32, conduit_int32);
CONDUIT_NODE_FAMILY(int64, conduit_int64);
CONDUIT_NODE_FAMILY(uint8, conduit_uint8);
CONDUIT_NODE_FAMILY(uint16, conduit_uint16);
CONDUIT_NODE_FAMILY(uint32, conduit_uint32);
CONDUIT_NODE_FAMILY(uint64, conduit_uint64);
CONDUIT_NODE_FAMILY(float32, conduit_float32);
CONDUIT_NODE_FAMILY(float64, conduit_float64);
CONDUIT_NODE_FAMILY(char, char);
CONDUIT_NODE_FAMILY(short, short);
CONDUIT_NODE_FAMILY(int, int);
CONDUIT_NODE_FAMILY(long, long);
CONDUIT_NODE_FAMILY(signed_char, signed char);
CONDUIT_NODE_FAMILY(signed_short, signed short);
CONDUIT_NODE_FAMILY(signed_int, signed int);
CONDUIT_NODE_FAMILY(signed_long, signed long);
CONDUIT_NODE_FAMILY(unsigned_char, unsigned char);
CONDUIT_NODE_FAMILY(unsigned_short, unsigned short);
CONDUIT_NODE_FAMILY(unsigned_int, unsigned int);
CONDUIT_NODE_FAMILY(unsigned_long, unsigned long);
CONDUIT_NODE_FAMILY(float, float);
CONDUIT_NODE_FAMILY(double, double);
#undef CONDUIT_NODE_FAMILY
#undef CONDUIT_NODE_LAYOUT

#ifdef __cplusplus
}
#endif

#endif
