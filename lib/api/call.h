/* How each call on a context begins and ends. */
#ifndef FATHOM_CALL_H
#define FATHOM_CALL_H

#include "context.h"

/* FATHOM_OK; FATHOM_ERROR_ARGUMENT for NULL; FATHOM_ERROR_DEVICE when the context is dead. */
int call_begin(fathom *f);

/* Returns OpenCL's first error in this call; an error makes the context dead. */
int call_end(fathom *f);

/* Keeps and logs the text; returns FATHOM_ERROR_ARGUMENT. */
#define call_refuse(f, ...) error_text_fail(&(f)->error, FATHOM_ERROR_ARGUMENT, FATHOM_LOG_ERROR, __VA_ARGS__)

/* The size of the caller's struct, or 0, with a text that names it. */
size_t call_struct(fathom *f, const void *callers, const char *name);

/* Takes a caller's struct in; FATHOM_OK or FATHOM_ERROR_ARGUMENT, with a text that names it. */
int call_take(fathom *f, void *whole, size_t size, const void *callers, const char *name);

#endif
