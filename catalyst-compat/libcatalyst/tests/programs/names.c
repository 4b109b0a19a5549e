/* Names that programs take from the headers, as a program of somebody else's uses them. */
#include <stdio.h>
#include <string.h>

#include <catalyst.h>
#include <catalyst_stub.h>
#include <conduit.h>
#include <conduit_blueprint.h>
#include <conduit_blueprint_c_exports.h>
#include <conduit_blueprint_config.h>
#include <conduit_c_exports.h>
#include <catalyst_conduit_blueprint_mangle.h>

#include "check.h"

#if CATALYST_VERSION_NUMBER < CATALYST_VERSION_CHECK(2, 0, 0)
#error "this is Catalyst 2"
#endif
#if CATALYST_VERSION_NUMBER >= CATALYST_VERSION_CHECK(CATALYST_VERSION_MAJOR, CATALYST_VERSION_MINOR, CATALYST_VERSION_PATCH + 1)
#error "a later version is greater"
#endif
#if CATALYST_VERSION_CHECK(2, 99, 99) >= CATALYST_VERSION_CHECK(3, 0, 0)
#error "a greater part counts for more than a lesser"
#endif
#if !CONDUIT_HAS_LONG_LONG || !defined(CONDUIT_USE_CXX11)
#error "long long and C++11 are there"
#endif
#if CONDUIT_SIZEOF_LONG_LONG != 8 || CONDUIT_SIZEOF_VOID_P != 8
#error "64 bits"
#endif
/* Numbers that the preprocessor can compare. */
#if CONDUIT_NATIVE_INT_ID != 5 || CONDUIT_NATIVE_LONG_LONG_ID != 6 || CONDUIT_NATIVE_UNSIGNED_LONG_LONG_ID != 10
#error "numbers of types"
#endif
#ifndef INT_MAX
#error "limits.h comes with conduit.h"
#endif
#ifndef conduit_blueprint_verify
#error "names of Blueprint are mangled"
#endif

CATALYST_DEPRECATED_EXPORT int old_and_shown(void);
CATALYST_DEPRECATED_NO_EXPORT int old_and_hidden(void);
CATALYST_DEPRECATED int old(void);
CONDUIT_C_API int shown(void);
CONDUIT_BLUEPRINT_C_API int shown_too(void);

int shown(void)
{
  return 1;
}

int shown_too(void)
{
  return 2;
}

static const char* name_of(conduit_datatype_type_id id)
{
  switch (id)
  {
    case CONDUIT_INT8_ID:
      return CONDUIT_INT8_NATIVE_NAME;
    case CONDUIT_INT16_ID:
      return CONDUIT_INT16_NATIVE_NAME;
    case CONDUIT_INT32_ID:
      return CONDUIT_INT32_NATIVE_NAME;
    case CONDUIT_INT64_ID:
      return CONDUIT_INT64_NATIVE_NAME;
    case CONDUIT_UINT8_ID:
      return CONDUIT_UINT8_NATIVE_NAME;
    case CONDUIT_UINT16_ID:
      return CONDUIT_UINT16_NATIVE_NAME;
    case CONDUIT_UINT32_ID:
      return CONDUIT_UINT32_NATIVE_NAME;
    case CONDUIT_UINT64_ID:
      return CONDUIT_UINT64_NATIVE_NAME;
    case CONDUIT_FLOAT32_ID:
      return CONDUIT_FLOAT32_NATIVE_NAME;
    case CONDUIT_FLOAT64_ID:
      return CONDUIT_FLOAT64_NATIVE_NAME;
    default:
      return "";
  }
}

int main(void)
{
  conduit_node* node = conduit_node_create();
  conduit_node* info = conduit_node_create();
  conduit_index32_t few = 3;
  conduit_index64_t many = 4000000000;
  conduit_long_double wide = 1.5L;
  conduit_long_long longest = -1;
  conduit_unsigned_long_long longest_unsigned = 1;
  conduit_endianness_type_id order = CONDUIT_ENDIANNESS_LITTLE_ID;
  conduit_datatype_type_id id;

  CHECK(sizeof(few) == 4 && sizeof(many) == 8 && sizeof(conduit_index_t) == sizeof(many));
  CHECK(sizeof(wide) == CONDUIT_SIZEOF_LONG_DOUBLE && sizeof(longest) == CONDUIT_SIZEOF_LONG_LONG);
  CHECK(longest < 0 && longest_unsigned > 0);
  CHECK(sizeof(char) == CONDUIT_SIZEOF_CHAR && sizeof(short) == CONDUIT_SIZEOF_SHORT);
  CHECK(sizeof(int) == CONDUIT_SIZEOF_INT && sizeof(long) == CONDUIT_SIZEOF_LONG);
  CHECK(sizeof(float) == CONDUIT_SIZEOF_FLOAT && sizeof(double) == CONDUIT_SIZEOF_DOUBLE);
  CHECK(sizeof(void*) == CONDUIT_SIZEOF_VOID_P && CONDUIT_SIZEOF_BYTE == 1);

  conduit_node_set_path_int64(node, "many", many);
  id = (conduit_datatype_type_id)conduit_datatype_id(conduit_node_dtype(conduit_node_fetch(node, "many")));
  CHECK(id == CONDUIT_INT64_ID && id == CONDUIT_INDEX_T_ID && strcmp(name_of(id), "signed long") == 0);
  CHECK(strcmp(name_of(CONDUIT_FLOAT32_ID), "float") == 0 && strcmp(name_of(CONDUIT_OBJECT_ID), "") == 0);
  CHECK(conduit_datatype_endianness(conduit_node_dtype(conduit_node_fetch(node, "many"))) == order ||
    conduit_datatype_endianness_matches_machine(conduit_node_dtype(conduit_node_fetch(node, "many"))));
  CHECK(conduit_blueprint_verify("mesh", node, info) == 0);
  CHECK(shown() + shown_too() == 3);
  CHECK(CATALYST_VERSION_NUMBER == CATALYST_VERSION_CHECK(2, 0, 0));

  conduit_node_destroy(info);
  conduit_node_destroy(node);
  printf("names.c: ok\n");
  return 0;
}
