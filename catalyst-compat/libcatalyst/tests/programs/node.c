/* The node's C interface: each family of functions for each type, trees, comparisons, text, files, and what goes wrong. */
#include <conduit.h>
#include <conduit_blueprint.h>
#include <string.h>

#include "check.h"

static int errors = 0;
static char last[512];
static void note(const char* message, const char* file, int line)
{
  ++errors;
  snprintf(last, sizeof last, "%s", message);
  CHECK(file[0] != 0 && line > 0);
}

/* One more error than before, whose message holds a text. */
#define CHECK_ERROR(call, text)                                                                              \
  do                                                                                                         \
  {                                                                                                          \
    int before = errors;                                                                                     \
    call;                                                                                                    \
    CHECK(errors == before + 1);                                                                             \
    if (strstr(last, text) == NULL) fprintf(stderr, "the message is: %s\n", last);                           \
    CHECK(strstr(last, text) != NULL);                                                                       \
  } while (0)

#define FAMILY(stem, type, id)                                                                               \
  static void family_##stem(void)                                                                            \
  {                                                                                                          \
    conduit_node* node = conduit_node_create();                                                              \
    type data[6] = { 1, 2, 3, 4, 5, 6 };                                                                     \
    const conduit_index_t size = sizeof(type);                                                               \
    conduit_node_set_##stem(node, 7);                                                                        \
    CHECK(conduit_node_as_##stem(node) == 7);                                                                \
    CHECK(conduit_node_as_##stem##_ptr(node)[0] == 7);                                                       \
    CHECK(conduit_datatype_id(conduit_node_dtype(node)) == id);                                              \
    conduit_node_set_path_##stem(node, "a/b", 8);                                                            \
    CHECK(conduit_node_fetch_path_as_##stem(node, "a/b") == 8);                                              \
    conduit_node_set_path_##stem##_ptr(node, "c", data, 6);                                                  \
    CHECK(conduit_node_fetch_path_as_##stem##_ptr(node, "c")[5] == 6);                                       \
    CHECK(conduit_node_fetch_path_as_##stem##_ptr(node, "c") != data);                                       \
    conduit_node_set_path_##stem##_ptr_detailed(node, "d", data, 3, size, 2 * size, size, 0);                \
    CHECK(conduit_node_fetch_path_as_##stem##_ptr(node, "d")[0] == 2);                                       \
    CHECK(conduit_node_fetch_path_as_##stem##_ptr(node, "d")[2] == 6);                                       \
    CHECK(conduit_node_is_compact(conduit_node_fetch(node, "d")));                                           \
    conduit_node_set_path_external_##stem##_ptr(node, "e", data, 6);                                         \
    CHECK(conduit_node_fetch_path_as_##stem##_ptr(node, "e") == data);                                       \
    conduit_node_set_path_external_##stem##_ptr_detailed(node, "f", data, 3, size, 2 * size, size, 0);       \
    CHECK(conduit_node_fetch_path_as_##stem##_ptr(node, "f") == data + 1);                                   \
    CHECK(conduit_node_fetch_path_element_ptr(node, "f", 2) == data + 5);                                    \
    CHECK(!conduit_node_is_compact(conduit_node_fetch(node, "f")));                                          \
    CHECK(conduit_node_is_data_external(conduit_node_fetch(node, "f")));                                     \
    conduit_node_set_##stem##_ptr(node, data, 4);                                                            \
    CHECK(conduit_node_number_of_elements(node) == 4);                                                       \
    conduit_node_set_external_##stem##_ptr(node, data, 6);                                                   \
    conduit_node_set_##stem(node, 9);                                                                        \
    CHECK(data[0] == 9 && conduit_node_data_ptr(node) == data);                                              \
    conduit_node_set_external_##stem##_ptr_detailed(node, data, 2, 2 * size, 3 * size, size, 0);             \
    CHECK(conduit_node_as_##stem(node) == 3 && conduit_node_element_ptr(node, 1) == data + 5);               \
    conduit_node_reset(node);                                                                                \
    conduit_node_set_##stem##_ptr_detailed(node, data, 2, 2 * size, 3 * size, size, 0);                      \
    CHECK(conduit_node_as_##stem##_ptr(node)[1] == 6);                                                       \
    CHECK(conduit_datatype_element_bytes(conduit_node_dtype(node)) == size);                                 \
    conduit_node_set_char8_str(node, "text");                                                                \
    CHECK_ERROR(CHECK(conduit_node_as_##stem(node) == 0), "holds char8_str, not");                           \
    CHECK_ERROR(CHECK(conduit_node_as_##stem##_ptr(node) == NULL), "holds char8_str, not");                  \
    CHECK_ERROR(conduit_node_fetch_path_as_##stem(node, "x/y"), "'x/y' is not there");                       \
    conduit_node_destroy(node);                                                                              \
  }

#define ALL(what)                                                                                            \
  what(int8, conduit_int8, CONDUIT_INT8_ID) what(int16, conduit_int16, CONDUIT_INT16_ID)                     \
  what(int32, conduit_int32, CONDUIT_INT32_ID) what(int64, conduit_int64, CONDUIT_INT64_ID)                  \
  what(uint8, conduit_uint8, CONDUIT_UINT8_ID) what(uint16, conduit_uint16, CONDUIT_UINT16_ID)               \
  what(uint32, conduit_uint32, CONDUIT_UINT32_ID) what(uint64, conduit_uint64, CONDUIT_UINT64_ID)            \
  what(float32, conduit_float32, CONDUIT_FLOAT32_ID) what(float64, conduit_float64, CONDUIT_FLOAT64_ID)      \
  what(char, char, CONDUIT_INT8_ID) what(short, short, CONDUIT_INT16_ID) what(int, int, CONDUIT_INT32_ID)    \
  what(long, long, CONDUIT_INT64_ID) what(signed_char, signed char, CONDUIT_INT8_ID)                         \
  what(signed_short, signed short, CONDUIT_INT16_ID) what(signed_int, signed int, CONDUIT_INT32_ID)          \
  what(signed_long, signed long, CONDUIT_INT64_ID) what(unsigned_char, unsigned char, CONDUIT_UINT8_ID)      \
  what(unsigned_short, unsigned short, CONDUIT_UINT16_ID) what(unsigned_int, unsigned int, CONDUIT_UINT32_ID) \
  what(unsigned_long, unsigned long, CONDUIT_UINT64_ID) what(float, float, CONDUIT_FLOAT32_ID)               \
  what(double, double, CONDUIT_FLOAT64_ID)
ALL(FAMILY)
#define CALL(stem, type, id) family_##stem();

static void check_text(char* text, const char* wanted)
{
  if (strcmp(text, wanted) != 0) fprintf(stderr, "found:\n%s\nwanted:\n%s\n", text, wanted);
  CHECK(strcmp(text, wanted) == 0);
  free(text);
}

static void trees(void)
{
  conduit_node* node = conduit_node_create();
  CHECK(conduit_node_is_root(node) && conduit_node_parent(node) == NULL);
  conduit_node* leaf = conduit_node_fetch(node, "a//b/c");
  conduit_node_set_int32(leaf, 5);
  CHECK(!conduit_node_is_root(leaf));
  conduit_node_destroy(leaf); /* belongs to the tree: nothing happens */
  CHECK(conduit_node_fetch_existing(node, "/a/b/c") == leaf);
  CHECK(conduit_node_fetch(leaf, "../c") == leaf);
  check_text(conduit_node_name(leaf), "c");
  check_text(conduit_node_path(leaf), "a/b/c");
  conduit_node* list = conduit_node_fetch(node, "list");
  conduit_node_set_double(conduit_node_append(list), 1.5);
  conduit_node_set_char8_str(conduit_node_append(list), "two");
  CHECK(conduit_node_number_of_children(list) == 2);
  check_text(conduit_node_path(conduit_node_child(list, 1)), "list/[1]");
  CHECK(strcmp(conduit_node_fetch_path_as_char8_str(node, "list/[1]"), "two") == 0);

  conduit_node* odd = conduit_node_add_child(node, "with/slash");
  conduit_node_set_int(odd, 1);
  CHECK(conduit_node_has_child(node, "with/slash") && !conduit_node_has_path(node, "with/slash"));
  CHECK(conduit_node_child_by_name(node, "with/slash") == odd);
  check_text(conduit_node_name(odd), "{with/slash}");
  check_text(conduit_node_path(conduit_node_fetch(odd, "below")), "{with/slash}/below");
  conduit_node_remove_child_by_name(node, "with/slash");
  conduit_node_rename_child(node, "list", "renamed");
  CHECK(conduit_node_has_path(node, "renamed/[0]") && !conduit_node_has_path(node, "list"));
  conduit_node_remove_child(conduit_node_fetch(node, "renamed"), 0);
  CHECK(conduit_node_number_of_children(conduit_node_fetch(node, "renamed")) == 1);
  conduit_node_remove_path(node, "a/b/c");
  CHECK(!conduit_node_has_path(node, "a/b/c") && conduit_node_has_path(node, "a/b"));

  CHECK_ERROR(conduit_node_fetch(node, ""), "empty path");
  CHECK_ERROR(conduit_node_fetch(node, "../up"), "above the root");
  CHECK_ERROR(conduit_node_fetch_existing(node, "a/q"), "'a' has the children [b], not 'q'");
  CHECK_ERROR(conduit_node_child(node, 9), "none of number 9");
  CHECK_ERROR(conduit_node_child(node, -1), "none of number -1");
  CHECK_ERROR(conduit_node_rename_child(node, "a", "renamed"), "a child 'renamed' already");
  CHECK_ERROR(conduit_node_rename_child(node, "none", "x"), "'none'");
  CHECK_ERROR(conduit_node_remove_path(node, "none"), "'none'");
  CHECK_ERROR(conduit_node_fetch(NULL, "a"), "node is null");
  CHECK_ERROR(conduit_node_fetch(node, NULL), "path is null");
  CHECK_ERROR(conduit_node_set_char8_str(node, NULL), "text is null");
  CHECK_ERROR(conduit_node_set_int32_ptr(node, NULL, 3), "null address");
  conduit_int32 one = 1;
  CHECK_ERROR(conduit_node_set_int32_ptr(node, &one, -3), "-3 elements");
  CHECK_ERROR(conduit_node_set_external_int32_ptr_detailed(node, &one, 1, 0, 4, 8, 0), "8 bytes");
  CHECK_ERROR(conduit_node_set_external_int32_ptr_detailed(node, &one, 1L << 62, 0, 8, 4, 0), "stride");
  CHECK_ERROR(conduit_node_parse(node, "{\"a\": [1, 2", "json"), "line 1, column 12");
  CHECK_ERROR(conduit_node_parse(node, "{}", "toml"), "no protocol 'toml'");
  CHECK_ERROR(conduit_node_load(node, "no/such/file", "json"), "cannot be read");
  CHECK_ERROR(conduit_datatype_id(NULL), "datatype is null");
  CHECK(conduit_node_has_path(node, "renamed")); /* errors change nothing */

  /* A tree may be set to a part of itself, and a part to the whole, but may not borrow from itself. */
  conduit_node_set_path_int32(node, "p/q", 3);
  CHECK_ERROR(conduit_node_set_external_node(conduit_node_fetch(node, "p"), node), "cannot borrow");
  conduit_node_set_node(conduit_node_fetch(node, "p"), node);
  CHECK(conduit_node_fetch_path_as_int32(node, "p/p/q") == 3);
  conduit_node_set_node(node, conduit_node_fetch(node, "p/p"));
  CHECK(conduit_node_fetch_path_as_int32(node, "q") == 3);
  conduit_node_update(node, conduit_node_fetch(node, "q/.."));
  CHECK_ERROR(conduit_node_swap(node, conduit_node_fetch(node, "q")), "overlap");
  /* A path that is deeper than is allowed. */
  char deep[4096];
  for (int i = 0; i < 2047; ++i) memcpy(deep + 2 * i, "d/", 3);
  CHECK_ERROR(conduit_node_fetch(node, deep), "deeper than");
  conduit_node_destroy(node);
  conduit_node_destroy(NULL);
}

static void memory(void)
{
  conduit_float64 values[8] = { 0, 1, 2, 3, 4, 5, 6, 7 };
  conduit_node* node = conduit_node_create();
  conduit_node* copy = conduit_node_create();
  conduit_node_set_path_external_float64_ptr_detailed(node, "x", values, 4, 0, 16, 8, 0);
  conduit_node_set_path_external_float64_ptr_detailed(node, "y", values, 4, 8, 16, 8, 0);
  CHECK(conduit_node_total_strided_bytes(node) == 112 && conduit_node_total_bytes_compact(node) == 64);
  CHECK(conduit_node_total_bytes_allocated(node) == 0 && !conduit_node_is_contiguous(node));
  CHECK(conduit_blueprint_mcarray_is_interleaved(node));
  conduit_node_compact_to(node, copy);
  CHECK(conduit_node_is_contiguous(copy) && conduit_node_is_compact(copy));
  CHECK(conduit_node_total_bytes_allocated(copy) == 64);
  CHECK(conduit_node_fetch_path_as_float64_ptr(copy, "y")[3] == 7);
  CHECK(conduit_node_contiguous_with_node(conduit_node_fetch(copy, "y"), conduit_node_fetch(copy, "x")));
  CHECK(conduit_node_contiguous_with_address(conduit_node_fetch(copy, "y"), conduit_node_fetch_path_element_ptr(copy, "x", 4)));
  CHECK(!conduit_node_contiguous_with_address(copy, NULL));
  CHECK(!conduit_blueprint_mcarray_is_interleaved(copy));
  CHECK(conduit_blueprint_mcarray_to_interleaved(copy, copy) && conduit_blueprint_mcarray_is_interleaved(copy));
  CHECK(conduit_blueprint_mcarray_to_contiguous(copy, copy) && conduit_node_is_contiguous(copy));
  conduit_node* single = conduit_node_create();
  conduit_node_set_path_external_float64_ptr(single, "x", values, 8);
  CHECK(conduit_blueprint_mcarray_is_interleaved(single));
  conduit_node_destroy(single);
  /* What is taken out of a compact tree keeps its memory. */
  conduit_node* taken = conduit_node_create();
  conduit_node_move(taken, conduit_node_fetch(copy, "y"));
  conduit_node_reset(copy);
  CHECK(conduit_node_as_float64_ptr(taken)[2] == 5);
  conduit_node_info(taken, copy);
  CHECK(conduit_node_fetch_path_as_int64(copy, "total_strided_bytes") == 32);
  /* Setting fewer elements of the same type leaves the others as they are; more make new room. */
  conduit_float64 two[2] = { -1, -2 };
  conduit_node_set_external_float64_ptr(node, values, 8);
  conduit_node_set_float64_ptr(node, two, 2);
  CHECK(conduit_node_number_of_elements(node) == 8 && values[1] == -2 && values[2] == 2);
  conduit_node_set_external_float64_ptr(node, values, 1);
  conduit_node_set_float64_ptr(node, two, 2);
  CHECK(!conduit_node_is_data_external(node) && values[1] == -2);
  conduit_node_set_float64_ptr(node, conduit_node_as_float64_ptr(node) + 1, 1); /* from itself */
  CHECK(conduit_node_as_float64(node) == -2);
  /* Numbers in the other order of bytes are read as they are meant by whatever reads them as text. */
  unsigned char swapped[4] = { 0, 0, 1, 2 };
  conduit_node_set_external_int32_ptr_detailed(node, (conduit_int32*)swapped, 1, 0, 4, 4, CONDUIT_ENDIANNESS_BIG_ID);
  CHECK(conduit_datatype_is_big_endian(conduit_node_dtype(node)));
  check_text(conduit_node_to_json(node), "258");
  conduit_node_destroy(node);
  conduit_node_destroy(copy);
  conduit_node_destroy(taken);
}

static void comparisons(void)
{
  conduit_node *a = conduit_node_create(), *b = conduit_node_create(), *info = conduit_node_create();
  conduit_node_parse(a, "{\"x\": 1.0, \"y\": [1, 2, 3], \"s\": \"me\"}", "json");
  conduit_node_set_node(b, a);
  CHECK(!conduit_node_diff(a, b, info, 0));
  CHECK(strcmp(conduit_node_fetch_path_as_char8_str(info, "children/diff/y/valid"), "true") == 0);
  conduit_node_set_path_double(b, "x", 1.0 + 1e-9);
  CHECK(!conduit_node_diff(a, b, info, 1e-6) && conduit_node_diff(a, b, info, 1e-12));
  conduit_node_set_path_double(b, "x", 1.0);
  conduit_node_set_path_int(b, "more", 1);
  CHECK(conduit_node_diff(a, b, info, 0) && conduit_node_has_path(info, "children/missing/more"));
  CHECK(conduit_node_diff(b, a, info, 0) && conduit_node_has_path(info, "children/extra/more"));
  CHECK(!conduit_node_diff_compatible(a, b, info, 0) && conduit_node_diff_compatible(b, a, info, 0));
  conduit_int64 y[3] = { 1, 5, 3 };
  conduit_node_set_path_int64_ptr(b, "y", y, 3);
  CHECK(conduit_node_diff(a, b, info, 0));
  CHECK(conduit_node_fetch_path_as_int64_ptr(info, "children/diff/y/value")[1] == -3);
  conduit_node_set_path_char8_str(b, "s", "other");
  CHECK(conduit_node_diff(a, b, info, 0) && conduit_node_has_path(info, "children/diff/s/errors"));
  conduit_node_set_path_float32(b, "x", 1);
  CHECK(conduit_node_diff(a, b, info, 0) && !conduit_node_compatible(a, b));
  conduit_node_update(a, b);
  CHECK(!conduit_node_diff(a, b, info, 0) && conduit_node_compatible(a, b));
  conduit_node_set_path_int(b, "y", 3);
  conduit_node_update_compatible(b, a);
  CHECK(conduit_node_fetch_path_as_int(b, "y") == 3);
  conduit_node_update_external(b, a);
  CHECK(conduit_node_fetch_path_as_int64_ptr(b, "y") == conduit_node_fetch_path_as_int64_ptr(a, "y"));
  conduit_node_swap(b, info);
  conduit_node_destroy(b);
  conduit_node_destroy(info);
  conduit_node_destroy(a);
}

static void texts(const char* directory)
{
  conduit_node *node = conduit_node_create(), *read = conduit_node_create(), *options = conduit_node_create();
  conduit_node_parse(node, "{\"a\": 42.0}", "json");
  CHECK(conduit_node_fetch_path_as_double(node, "a") == 42.0);
  check_text(conduit_node_to_json(node), "\n{\n  \"a\": 42.0\n}");
  check_text(conduit_node_to_yaml(node), "\na: 42.0\n");
  check_text(conduit_node_to_string(node), "\na: 42.0\n");
  check_text(conduit_node_to_summary_string(node), "\na: 42.0\n");
  conduit_node_set_path_int(options, "depth", 1);
  conduit_node_set_path_char8_str(options, "pad", "..");
  conduit_node_set_path_char8_str(options, "eoe", ";\n");
  check_text(conduit_node_to_json_with_options(node, options), ";\n....{;\n........\"a\": 42.0;\n....}");
  check_text(conduit_node_to_yaml_with_options(node, options), ";\n....a: 42.0;\n");
  conduit_node_parse(node, "a:\n  - 1\n  - 2\nb: [1, 2.5]\nc: {d: text, e: 'it''s'} # and no more\n", "yaml");
  CHECK(conduit_node_fetch_path_as_int64_ptr(node, "a")[1] == 2);
  CHECK(conduit_node_fetch_path_as_float64_ptr(node, "b")[1] == 2.5);
  CHECK(strcmp(conduit_node_fetch_path_as_char8_str(node, "c/e"), "it's") == 0);
  const char* protocols[] = { "json", "yaml", "conduit_json", "conduit_base64_json", "conduit_bin" };
  for (int i = 0; i < 5; ++i)
  {
    char path[512];
    snprintf(path, sizeof path, "%s/tree.%s", directory, protocols[i]);
    conduit_node_save(node, path, "");
    conduit_node_load(read, path, NULL);
    CHECK(!conduit_node_diff(node, read, options, 0));
  }
  conduit_float32 data[6] = { 0, 1, 2, 3, 4, 5 };
  const char* schema = "{x: {dtype: float32, length: 3, stride: 8}, y: {dtype: float32, length: 3, offset: 4, stride: 8}}";
  conduit_node_generate_external(node, schema, "conduit_json", data);
  CHECK(conduit_node_fetch_path_element_ptr(node, "y", 2) == data + 5);
  conduit_node_generate(node, schema, "conduit_json", data);
  CHECK(conduit_node_fetch_path_as_float32_ptr(node, "y")[2] == 5 && !conduit_node_is_data_external(conduit_node_fetch(node, "y")));
  conduit_uint32 value = 0;
  conduit_node_generate_external(node, "{dtype: uint32, value: 42}", "conduit_json", &value);
  CHECK(value == 42);
  conduit_node_print(node);
  conduit_node_print_detailed(node);
  conduit_node_destroy(node);
  conduit_node_destroy(read);
  conduit_node_destroy(options);
}

static int warnings = 0;
static void note_warning(const char* message, const char* file, int line)
{
  (void)file;
  (void)line;
  ++warnings;
  CHECK(strstr(message, "'value' holds float64, not ") != NULL);
}

/* A value read as another type is told to the handler of warnings; what is not there to that of errors. */
static void handlers(void)
{
  conduit_node* node = conduit_node_create();
  conduit_node_set_path_double(node, "value", 42);
  conduit_node* value = conduit_node_fetch(node, "value");
  const int before = errors;
  conduit_utils_set_warning_handler(note_warning);
  CHECK(conduit_node_as_float32(value) == 0);
  CHECK(conduit_node_as_int_ptr(value) == NULL);
  CHECK(conduit_node_as_char8_str(value) == NULL);
  CHECK(conduit_node_fetch_path_as_uint8(node, "value") == 0);
  CHECK(warnings == 4 && errors == before);
  CHECK(conduit_node_fetch_existing(value, "nothing") == NULL);
  CHECK(warnings == 4 && errors == before + 1);
  conduit_utils_set_warning_handler(note);
  conduit_node_destroy(node);
}

/* A text of a node, written by a function that may have options. */
#define CHECK_TEXT(call, expected)                                                                           \
  do                                                                                                         \
  {                                                                                                          \
    char* text = call;                                                                                       \
    if (strcmp(text, expected) != 0) fprintf(stderr, "the text is: %s\n", text);                             \
    CHECK(strcmp(text, expected) == 0);                                                                      \
    free(text);                                                                                              \
  } while (0)

static void summaries(void)
{
  conduit_node* node = conduit_node_create();
  conduit_node* options = conduit_node_create();
  conduit_node* info = conduit_node_create();
  conduit_int64 numbers[10] = { 0, 1, 2, 3, 4, 5, 6, 7, 8, 9 };
  conduit_node_set_path_external_int64_ptr(node, "a", numbers, 10);
  conduit_node_set_path_int(node, "b", 1);
  for (int i = 1; i < 5; ++i) conduit_node_set_int(conduit_node_append(conduit_node_fetch(node, "c")), 10 * i);
  conduit_node_set_path_int(options, "num_children_threshold", 2);
  conduit_node_set_path_int(options, "num_elements_threshold", 4);
  CHECK_TEXT(conduit_node_to_summary_string_with_options(node, options),
    "\na: [0, 1, ..., 8, 9]\n... ( skipped 1 child )\nc: \n  - 10\n  ... ( skipped 2 children )\n  - 40\n");
  /* A threshold that is not positive leaves nothing out. */
  conduit_node_set_path_int(options, "num_children_threshold", -1);
  conduit_node_set_path_int(options, "num_elements_threshold", 0);
  CHECK_TEXT(conduit_node_to_summary_string_with_options(node, options),
    "\na: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]\nb: 1\nc: \n  - 10\n  - 20\n  - 30\n  - 40\n");
  conduit_node_reset(options);
  conduit_node_set_path_int(options, "depth", 1);
  conduit_node_set_path_char8_str(options, "pad", "-");
  conduit_node_set_path_char8_str(options, "eoe", ";");
  CHECK_TEXT(conduit_node_to_json_with_options(conduit_node_fetch(node, "c"), options), ";--[;----10,;----20,;----30,;----40;--]");

  /* Only what the tree owns has a size of its own. */
  conduit_node_info(node, info);
  conduit_node* spaces = conduit_node_fetch(info, "mem_spaces");
  CHECK(conduit_node_number_of_children(info) == 5 && conduit_node_number_of_children(spaces) == 6);
  for (conduit_index_t i = 0; i < 6; ++i)
  {
    conduit_node* space = conduit_node_child(spaces, i);
    const int external = strcmp(conduit_node_fetch_path_as_char8_str(space, "type"), "external") == 0;
    CHECK(external == (i == 0) && conduit_node_has_path(space, "bytes") == !external);
  }
  CHECK(conduit_node_fetch_path_as_int64(info, "total_bytes_allocated") == 5 * 4);
  conduit_node_destroy(node);
  conduit_node_destroy(options);
  conduit_node_destroy(info);
}

static void datatypes(void)
{
  conduit_node* node = conduit_node_create();
  CHECK(conduit_datatype_sizeof_index_t() == 8);
  CHECK(conduit_datatype_is_empty(conduit_node_dtype(node)));
  conduit_float32 data[4] = { 0 };
  conduit_node_set_external_float32_ptr_detailed(node, data, 2, 4, 8, 4, 0);
  const conduit_datatype* type = conduit_node_dtype(node);
  CHECK(conduit_datatype_is_float32(type) && conduit_datatype_is_float(type) && !conduit_datatype_is_double(type));
  CHECK(conduit_datatype_is_number(type) && conduit_datatype_is_floating_point(type) && !conduit_datatype_is_integer(type));
  CHECK(conduit_datatype_offset(type) == 4 && conduit_datatype_stride(type) == 8);
  CHECK(conduit_datatype_element_index(type, 1) == 12 && conduit_datatype_number_of_elements(type) == 2);
  CHECK(conduit_datatype_endianness_matches_machine(type) && conduit_datatype_endianness(type) == 0);
  char* name = conduit_datatype_name(type);
  CHECK(strcmp(name, "float32") == 0);
  conduit_datatype_name_destroy(name);
  conduit_node_set_external_char8_str(node, (char[]){ "lent" });
  CHECK(conduit_datatype_is_string(conduit_node_dtype(node)) && conduit_datatype_is_char8_str(conduit_node_dtype(node)));
  conduit_node_append(node);
  CHECK(conduit_datatype_is_list(conduit_node_dtype(node)));
  conduit_node_fetch(node, "name");
  CHECK(conduit_datatype_is_object(conduit_node_dtype(node)) && conduit_node_number_of_children(node) == 1);
  conduit_node_destroy(node);
}

int main(int argc, char** argv)
{
  CHECK(argc == 2);
  /* Without a handler, in a program without C++, an error is printed and the call answers with nothing. */
  CHECK(conduit_node_fetch(NULL, "a") == NULL);
  conduit_utils_set_error_handler(note);
  conduit_utils_set_warning_handler(note);
  conduit_utils_set_info_handler(note);
  ALL(CALL)
  trees();
  memory();
  comparisons();
  texts(argv[1]);
  datatypes();
  handlers();
  summaries();
  puts("node.c: ok");
  return 0;
}
