/* Types by their width, types by their C names, and their numbers. For 64-bit platforms on which int has 32 bits and long 64. */
#ifndef conduit_bitwidth_style_types_h
#define conduit_bitwidth_style_types_h

#include <limits.h>

#include "conduit_config.h"

#if LONG_MAX != 9223372036854775807L || INT_MAX != 2147483647
#error "conduit_bitwidth_style_types.h is for platforms on which int has 32 bits and long 64"
#endif

/* Bytes of the types of C. */
#define CONDUIT_SIZEOF_BYTE 1
#define CONDUIT_SIZEOF_CHAR 1
#define CONDUIT_SIZEOF_SHORT 2
#define CONDUIT_SIZEOF_INT 4
#define CONDUIT_SIZEOF_LONG 8
#define CONDUIT_SIZEOF_LONG_LONG 8
#define CONDUIT_SIZEOF_FLOAT 4
#define CONDUIT_SIZEOF_DOUBLE 8
#if defined(__SIZEOF_LONG_DOUBLE__)
#define CONDUIT_SIZEOF_LONG_DOUBLE __SIZEOF_LONG_DOUBLE__
#else
#define CONDUIT_SIZEOF_LONG_DOUBLE 16
#endif
#define CONDUIT_SIZEOF_VOID_P 8

/* Types that the compiler has, and those that stand for one by width. */
#define CONDUIT_HAS_LONG_LONG 1
#define CONDUIT_HAS_LONG_DOUBLE 1
#define CONDUIT_USE_CHAR 1
#define CONDUIT_USE_SHORT 1
#define CONDUIT_USE_INT 1
#define CONDUIT_USE_LONG 1
#define CONDUIT_USE_FLOAT 1
#define CONDUIT_USE_DOUBLE 1

/* Whether the types without a sign in their name have one. */
#if CHAR_MIN == 0
#define CONDUIT_CHAR_IS_UNSIGNED
#else
#define CONDUIT_CHAR_IS_SIGNED
#endif
#define CONDUIT_SHORT_IS_SIGNED
#define CONDUIT_INT_IS_SIGNED
#define CONDUIT_LONG_IS_SIGNED
#define CONDUIT_LONG_LONG_IS_SIGNED

/* The numbers of the types. */
typedef enum
{
  CONDUIT_EMPTY_ID = 0,
  CONDUIT_OBJECT_ID = 1,
  CONDUIT_LIST_ID = 2,
  CONDUIT_INT8_ID = 3,
  CONDUIT_INT16_ID = 4,
  CONDUIT_INT32_ID = 5,
  CONDUIT_INT64_ID = 6,
  CONDUIT_UINT8_ID = 7,
  CONDUIT_UINT16_ID = 8,
  CONDUIT_UINT32_ID = 9,
  CONDUIT_UINT64_ID = 10,
  CONDUIT_FLOAT32_ID = 11,
  CONDUIT_FLOAT64_ID = 12,
  CONDUIT_CHAR8_STR_ID = 13
} conduit_datatype_type_id;

#define CONDUIT_EMPTY_T CONDUIT_EMPTY_ID
#define CONDUIT_OBJECT_T CONDUIT_OBJECT_ID
#define CONDUIT_LIST_T CONDUIT_LIST_ID
#define CONDUIT_INT8_T CONDUIT_INT8_ID
#define CONDUIT_INT16_T CONDUIT_INT16_ID
#define CONDUIT_INT32_T CONDUIT_INT32_ID
#define CONDUIT_INT64_T CONDUIT_INT64_ID
#define CONDUIT_UINT8_T CONDUIT_UINT8_ID
#define CONDUIT_UINT16_T CONDUIT_UINT16_ID
#define CONDUIT_UINT32_T CONDUIT_UINT32_ID
#define CONDUIT_UINT64_T CONDUIT_UINT64_ID
#define CONDUIT_FLOAT32_T CONDUIT_FLOAT32_ID
#define CONDUIT_FLOAT64_T CONDUIT_FLOAT64_ID
#define CONDUIT_CHAR8_STR_T CONDUIT_CHAR8_STR_ID

/* Which types of C are the types by width. */
#define CONDUIT_INT8_NATIVE_TYPE signed char
#define CONDUIT_INT16_NATIVE_TYPE signed short
#define CONDUIT_INT32_NATIVE_TYPE signed int
#define CONDUIT_INT64_NATIVE_TYPE signed long
#define CONDUIT_UINT8_NATIVE_TYPE unsigned char
#define CONDUIT_UINT16_NATIVE_TYPE unsigned short
#define CONDUIT_UINT32_NATIVE_TYPE unsigned int
#define CONDUIT_UINT64_NATIVE_TYPE unsigned long
#define CONDUIT_FLOAT32_NATIVE_TYPE float
#define CONDUIT_FLOAT64_NATIVE_TYPE double
#define CONDUIT_INT8_NATIVE_NAME "signed char"
#define CONDUIT_INT16_NATIVE_NAME "signed short"
#define CONDUIT_INT32_NATIVE_NAME "signed int"
#define CONDUIT_INT64_NATIVE_NAME "signed long"
#define CONDUIT_UINT8_NATIVE_NAME "unsigned char"
#define CONDUIT_UINT16_NATIVE_NAME "unsigned short"
#define CONDUIT_UINT32_NATIVE_NAME "unsigned int"
#define CONDUIT_UINT64_NATIVE_NAME "unsigned long"
#define CONDUIT_FLOAT32_NATIVE_NAME "float"
#define CONDUIT_FLOAT64_NATIVE_NAME "double"

typedef signed char conduit_int8;
typedef signed short conduit_int16;
typedef signed int conduit_int32;
typedef signed long conduit_int64;
typedef unsigned char conduit_uint8;
typedef unsigned short conduit_uint16;
typedef unsigned int conduit_uint32;
typedef unsigned long conduit_uint64;
typedef float conduit_float32;
typedef double conduit_float64;

typedef conduit_int32 conduit_index32_t;
typedef conduit_int64 conduit_index64_t;
typedef conduit_index64_t conduit_index_t;
#define CONDUIT_INDEX_T_ID CONDUIT_INT64_ID

/* The types of C by names of Conduit's. */
#if CHAR_MIN == 0
typedef unsigned char conduit_char;
#else
typedef signed char conduit_char;
#endif
typedef short conduit_short;
typedef int conduit_int;
typedef long conduit_long;
typedef long long conduit_long_long;
typedef signed char conduit_signed_char;
typedef signed short conduit_signed_short;
typedef signed int conduit_signed_int;
typedef signed long conduit_signed_long;
typedef signed long long conduit_signed_long_long;
typedef unsigned char conduit_unsigned_char;
typedef unsigned short conduit_unsigned_short;
typedef unsigned int conduit_unsigned_int;
typedef unsigned long conduit_unsigned_long;
typedef unsigned long long conduit_unsigned_long_long;
typedef float conduit_float;
typedef double conduit_double;
typedef long double conduit_long_double;

/* The types by width that the types of C are, and their numbers, which the preprocessor can compare. */
#define CONDUIT_NATIVE_SIGNED_CHAR conduit_int8
#define CONDUIT_NATIVE_SIGNED_CHAR_ID 3
#define CONDUIT_NATIVE_SIGNED_SHORT conduit_int16
#define CONDUIT_NATIVE_SIGNED_SHORT_ID 4
#define CONDUIT_NATIVE_SIGNED_INT conduit_int32
#define CONDUIT_NATIVE_SIGNED_INT_ID 5
#define CONDUIT_NATIVE_SIGNED_LONG conduit_int64
#define CONDUIT_NATIVE_SIGNED_LONG_ID 6
#define CONDUIT_NATIVE_SIGNED_LONG_LONG conduit_int64
#define CONDUIT_NATIVE_SIGNED_LONG_LONG_ID 6
#define CONDUIT_NATIVE_UNSIGNED_CHAR conduit_uint8
#define CONDUIT_NATIVE_UNSIGNED_CHAR_ID 7
#define CONDUIT_NATIVE_UNSIGNED_SHORT conduit_uint16
#define CONDUIT_NATIVE_UNSIGNED_SHORT_ID 8
#define CONDUIT_NATIVE_UNSIGNED_INT conduit_uint32
#define CONDUIT_NATIVE_UNSIGNED_INT_ID 9
#define CONDUIT_NATIVE_UNSIGNED_LONG conduit_uint64
#define CONDUIT_NATIVE_UNSIGNED_LONG_ID 10
#define CONDUIT_NATIVE_UNSIGNED_LONG_LONG conduit_uint64
#define CONDUIT_NATIVE_UNSIGNED_LONG_LONG_ID 10
#if CHAR_MIN == 0
#define CONDUIT_NATIVE_CHAR CONDUIT_NATIVE_UNSIGNED_CHAR
#define CONDUIT_NATIVE_CHAR_ID CONDUIT_NATIVE_UNSIGNED_CHAR_ID
#else
#define CONDUIT_NATIVE_CHAR CONDUIT_NATIVE_SIGNED_CHAR
#define CONDUIT_NATIVE_CHAR_ID CONDUIT_NATIVE_SIGNED_CHAR_ID
#endif
#define CONDUIT_NATIVE_SHORT CONDUIT_NATIVE_SIGNED_SHORT
#define CONDUIT_NATIVE_SHORT_ID CONDUIT_NATIVE_SIGNED_SHORT_ID
#define CONDUIT_NATIVE_INT CONDUIT_NATIVE_SIGNED_INT
#define CONDUIT_NATIVE_INT_ID CONDUIT_NATIVE_SIGNED_INT_ID
#define CONDUIT_NATIVE_LONG CONDUIT_NATIVE_SIGNED_LONG
#define CONDUIT_NATIVE_LONG_ID CONDUIT_NATIVE_SIGNED_LONG_ID
#define CONDUIT_NATIVE_LONG_LONG CONDUIT_NATIVE_SIGNED_LONG_LONG
#define CONDUIT_NATIVE_LONG_LONG_ID CONDUIT_NATIVE_SIGNED_LONG_LONG_ID
#define CONDUIT_NATIVE_FLOAT conduit_float32
#define CONDUIT_NATIVE_FLOAT_ID 11
#define CONDUIT_NATIVE_DOUBLE conduit_float64
#define CONDUIT_NATIVE_DOUBLE_ID 12

#endif
