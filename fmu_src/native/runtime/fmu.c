/* The whole FMU as one compilation unit, so that it shows nothing but the FMI functions. */

#if defined(_MSC_VER) && !defined(_CRT_SECURE_NO_WARNINGS)
#define _CRT_SECURE_NO_WARNINGS
#endif

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#include "model.c"

#include "noise.c"

#include "instance.c"

#include "saved_state.c"

#include "fmi2.c"
