#include "fathom/shell/library.h"
#include "fathom/shell/cli.h"

#include <stdlib.h>

int library_status(int error) {
    return error == FATHOM_ERROR_CONFIG || error == FATHOM_ERROR_MEMORY ? CLI_USAGE : CLI_FAILED;
}

int library_start(struct library *library, fathom_config *config, struct cli_log *log) {
    config->log = log_message;
    config->log_user = log;
    log_clear(log);
    library->plan = FATHOM_STRUCT(fathom_memory_plan);
    int result = fathom_plan_memory(config, &library->plan, NULL, 0);
    if (result < 0) return cli_error(library_status(result), "%s", log_reason(log, result));
    const size_t align = FATHOM_ALIGNMENT,
                 size = ((size_t)library->plan.host_bytes + align - 1) / align * align;
    library->memory = aligned_alloc(align, size);
    if (!library->memory) return cli_error(CLI_FAILED, "out of memory: %zu bytes for the library", size);
    result = fathom_init(&library->scan, config, library->memory, size, NULL, 0);
    return result < 0 ? cli_error(library_status(result), "%s", log_reason(log, result)) : CLI_DONE;
}

void library_stop(struct library *library) {
    fathom_close(library->scan);
    free(library->memory);
    *library = (struct library){0};
}
