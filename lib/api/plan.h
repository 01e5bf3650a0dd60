/* The layout of the caller's block, and its size. */
#ifndef FATHOM_PLAN_H
#define FATHOM_PLAN_H

#include "context.h"

/* Lays all parts out: only counts while the device isn't open and the arena has no base. */
void plan_layout(fathom *f, arena *a, int blocks);

/* Takes the settings, chooses the device and counts. f is a scratch context, zeroed here, and has the error text after
 * a failure. plan is the library's whole struct. FATHOM_OK, _ARGUMENT, _CONFIG, _MEMORY or _DEVICE. */
int plan_make(fathom *f, const fathom_config *config, fathom_memory_plan *plan);

#endif
