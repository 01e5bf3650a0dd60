#!/bin/sh
# Prints a C file that holds each OpenCL source given as a string: kernel_sources[], kernel_names[], kernel_count.
echo '#include "cl/kernels.h"'
echo 'const char *const kernel_sources[] = {'
for f in "$@"; do
    sed -e 's/\\/\\\\/g' -e 's/"/\\"/g' -e 's/^/    "/' -e 's/$/\\n"/' "$f"
    echo '    ,'
done
echo '};'
echo 'const char *const kernel_names[] = {'
for f in "$@"; do echo "    \"$(basename "$f")\","; done
echo '};'
echo "const int kernel_count = $#;"
