/* The OpenCL sources of opencl/, embedded by lib/cl/embed.sh at build time. */
#ifndef FATHOM_KERNELS_H
#define FATHOM_KERNELS_H

extern const char *const kernel_sources[]; /* text of each file, in the order of their names */
extern const char *const kernel_names[];   /* file names, without the folder */
extern const int kernel_count;

#endif
